"""What the camera of a twin with foreign variants sees: its light sampled, by no formula of the solver.

The usual renderer and the solver share the closed form of a line's profile. This one shares no formula of it
with them: the spread of light is sampled, and light is followed wavelength by wavelength.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.foreign.lenses import camera_of_colour, centre_ratio
from dsl_core.simulation.foreign.light_sources import FINE_NM, Sources, trace
from dsl_core.simulation.foreign.rig_changes import led_radiance
from dsl_core.simulation.foreign.spread import FINE, Spread
from dsl_core.simulation.foreign.transport import Axis, Brought, Frame, sampled
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.rendering.shading import surface_shading
from dsl_core.simulation.rendering.spectral_tables import ORDERS
from dsl_core.simulation.scenes.truth import Scene, SceneTruth

Floats = NDArray[np.float64]
ALL_LEDS = (0, 1, 2)
#: Samples a pixel of the spread picture of a pattern that varies both ways, and of the sampled wavelengths
#: one in so many is looked up.
COARSE, EVERY = 4, 4
#: Wavelengths through which a filter passes less than this are not followed.
DARK = 1e-6


@dataclass(frozen=True)
class _Parts:
    """What light comes from, seen by one colour: ``pixel``, ``kind`` and ``shading``, and its sources."""

    pixel: Tensor
    kind: Tensor
    shading: Tensor
    sources: tuple[Sources, ...]


class ForeignRenderer:
    """Expected signal of one scene on one true rig, DN per ms above black; a `PatternView`."""

    def __init__(
        self,
        rig: Rig,
        scene: Scene,
        foreign: Foreign,
        *,
        film: bool = True,
        device: str = "cpu",
        orders: tuple[int, ...] = ORDERS,
        shaded: bool = True,
    ) -> None:
        self.rig, self.foreign = rig, foreign
        self.device = torch.device(device)
        self.shape = (rig.camera.height_px, rig.camera.width_px)
        projector = rig.projector
        size = (projector.width_px, projector.height_px)
        spread = Spread(rig.projector_response.blur_px, foreign)
        self._frame = Frame(size, rig.projector_response, spread, film)
        self._orders = (0, *(orders if film else ()))
        self._filter: tuple[Floats, Floats] | None = None
        self._mosaic = bayer_channels(rig.sensor.bayer, *self.shape)
        self._colours: dict[int, _Parts] = {}
        self._tables: dict[tuple[int | None, Axis, tuple[int, ...]], Tensor] = {}
        self._whites: dict[int, Tensor] = {}
        self._scene, self._shaded = scene, shaded
        self._reflectance: Floats = scene.materials.at(FINE_NM)

    def through(self, transmission: SpectralCurve | None) -> ForeignRenderer:
        """See `PatternView`; the geometry is shared."""
        other = copy.copy(self)
        other._tables, other._whites = {}, {}
        other._filter = None
        if transmission is not None:
            other._filter = (np.array(transmission.wavelengths_nm), np.array(transmission.values))
        return other

    def expected(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See `PatternView`."""
        return self._picture(None, image)

    def planes(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See `PatternView`."""
        return np.stack([self._picture(channel, image) for channel in range(3)])

    def _picture(self, channel: int | None, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Signal of the mosaic (channel None), or of all pixels in one colour, (rows, columns)."""
        image = image if image.ndim == 3 else image[..., None]
        image = np.broadcast_to(image, (*image.shape[:2], 3))
        response = self._frame.response
        black = response.black_fraction
        levels = led_radiance(response, np.arange(256)[None] / 255, self.foreign) - black
        out = torch.zeros(self.shape[0] * self.shape[1], device=self.device)
        spread = _SpreadPictures(self._frame, image, levels)
        for colour in self._seen(channel):
            parts = self._parts(colour, channel)
            light = self._light(colour, channel, spread)
            if black:
                light = light + black * self._white(colour, channel)
            out.index_add_(0, parts.pixel, light * parts.shading)
        return out.reshape(self.shape).cpu().numpy()

    def _seen(self, channel: int | None) -> tuple[int, ...]:
        return (0, 1, 2) if channel is None else (channel,)

    def _light(self, colour: int, channel: int | None, spread: _SpreadPictures) -> Tensor:
        """Light of a pattern on the parts of a colour, (parts,), at unit shading and without black."""
        axis: Axis
        image, levels = spread.image, spread.levels
        if (image == image[:1]).all():
            axis, line = "columns", image[0]
        elif (image == image[:, :1]).all():
            axis, line = "rows", image[:, 0]
        else:
            return self._free(colour, channel, spread)
        radiance = np.stack([levels[led][line[:, led]] for led in ALL_LEDS])
        groups: list[tuple[tuple[int, ...], Floats]] = [((k,), radiance[k]) for k in ALL_LEDS]
        if (radiance == radiance[:1]).all():
            groups = [(ALL_LEDS, radiance[0])]
        total = torch.zeros(len(self._parts(colour, channel).pixel), device=self.device)
        for leds, profile in groups:
            lit = np.flatnonzero(profile)
            if len(lit):
                table = self._table(colour, channel, axis, leds)
                weights = torch.as_tensor(profile[lit], dtype=torch.float32, device=self.device)
                total += weights @ table[torch.as_tensor(lit, device=self.device)]
        return total

    def _free(self, colour: int, channel: int | None, spread: _SpreadPictures) -> Tensor:
        """Light of a pattern that varies both ways."""
        parts = self._parts(colour, channel)
        total = torch.zeros(len(parts.pixel), device=self.device)
        for led in ALL_LEDS:
            for sources in parts.sources:
                brought = self._brought(colour, channel, sources.order, (led,), self._wavelengths())
                picture = spread.of(led, halo=sources.order == 0)
                total[sources.active] += _free_pattern(picture, sources, brought, self._wavelengths())
        return total

    def _parts(self, colour: int, channel: int | None) -> _Parts:
        """Parts of the scene as one colour sees it: its pixels of the mosaic, or all pixels."""
        key = colour if channel is None else 3 + channel
        if key not in self._colours:
            lens = camera_of_colour(self.rig.camera, colour, self.foreign)
            rig = self.rig.model_copy(update={"camera": lens})
            truth = self._scene.render(lens, rig.pose.projector_centre_mm)
            self._colours[key] = self._traced(rig, truth, colour, everywhere=channel is not None)
        return self._colours[key]

    def _traced(self, rig: Rig, truth: SceneTruth, colour: int, everywhere: bool) -> _Parts:
        pixel, material, share = truth.parts()
        if not everywhere:
            own = self._mosaic.ravel()[pixel] == colour
            pixel, material, share = pixel[own], material[own], share[own]
        depth = torch.as_tensor(truth.depth_mm.ravel()[pixel])
        shading = surface_shading(rig, truth, self._shaded).ravel()[pixel] * share
        pixels = torch.as_tensor(pixel)
        sources = tuple(
            trace(rig, self.foreign, order, pixels, depth, torch.as_tensor(shading > 0))
            for order in self._orders
        )
        return _Parts(
            pixels.to(self.device),
            torch.as_tensor(material.astype(np.int64) * 3 + colour, device=self.device),
            torch.as_tensor(shading, dtype=torch.float32, device=self.device),
            sources,
        )

    def _wavelengths(self) -> Floats:
        """Wavelengths that are followed: all, or those that the filter passes at any angle."""
        if self._filter is None:
            return FINE_NM
        nm, values = self._filter
        passed = nm[values > DARK * values.max()]
        ratio = float(centre_ratio(self.rig.camera, self.foreign).min())
        chosen = (passed.min() * ratio - 1 <= FINE_NM) & (passed.max() + 1 >= FINE_NM)
        return np.asarray(FINE_NM[chosen])

    def _brought(
        self,
        colour: int,
        channel: int | None,
        order: int,
        leds: tuple[int, ...],
        wavelengths_nm: Floats,
    ) -> Brought:
        parts = self._parts(colour, channel)
        chain = chain_response(self.rig, order, FINE_NM)[:, list(leds)].sum(1)
        density = self._reflectance[:, None] * chain[None]
        chosen = np.isin(FINE_NM, wavelengths_nm)
        light = sampled(density)[..., torch.as_tensor(chosen)]
        ratio = centre_ratio(self.rig.camera, self.foreign)
        return Brought(
            light.reshape(-1, light.shape[-1]).to(self.device),
            parts.kind,
            self._filter,
            torch.as_tensor(ratio)[parts.pixel.cpu()],
        )

    def _white(self, colour: int, channel: int | None) -> Tensor:
        """Light of a white pattern on the parts of a colour, (parts,)."""
        key = colour if channel is None else 3 + channel
        if key not in self._whites:
            self._whites[key] = self._table(colour, channel, "columns", ALL_LEDS).sum(0)
        return self._whites[key]

    def _table(self, colour: int, channel: int | None, axis: Axis, leds: tuple[int, ...]) -> Tensor:
        """Light of every column or row on the parts of a colour, (lines, parts)."""
        key = (colour if channel is None else 3 + channel, axis, leds)
        if key not in self._tables:
            parts, nm = self._parts(colour, channel), self._wavelengths()
            table = torch.zeros((len(parts.pixel), self._frame.lines(axis)), device=self.device)
            for sources in parts.sources:
                brought = self._brought(colour, channel, sources.order, leds, nm)
                self._frame.add(table, axis, sources, brought, nm)
            self._tables[key] = table.T.contiguous()
        return self._tables[key]


class _SpreadPictures:
    """A pattern (height, width, LEDs) of drive levels, spread once for all orders and colours.

    ``levels`` (LEDs, 256) is the radiance of each level.
    """

    def __init__(self, frame: Frame, image: NDArray[np.uint8], levels: Floats) -> None:
        self.image, self.levels = image, levels
        self._frame = frame
        self._pictures: dict[tuple[int, bool], Tensor] = {}

    def of(self, led: int, halo: bool) -> Tensor:
        """What an LED shows, with or without halo, (height * COARSE, width * COARSE)."""
        if (led, halo) not in self._pictures:
            picture = _spread_picture(self._frame, self.levels[led][self.image[..., led]], halo)
            self._pictures[led, halo] = torch.as_tensor(picture, dtype=torch.float32)
        return self._pictures[led, halo]


def _free_pattern(picture: Tensor, sources: Sources, brought: Brought, wavelengths_nm: Floats) -> Tensor:
    """Light on an order's active parts, (active,), of a pattern that varies both ways.

    It is looked up in the spread picture of the pattern. The spread is the usual one all over the frame,
    whatever it is in the corners.
    """
    height, width = picture.shape
    source = picture[None, None]
    light = brought.of(sources.active, wavelengths_nm)
    every = EVERY if len(wavelengths_nm) > 100 else 1
    total = torch.zeros(len(sources.active))
    for i in range(0, len(wavelengths_nm), every):
        some = slice(i, i + every)
        columns, rows = (q.float() for q in sources.at(wavelengths_nm[some].mean(keepdims=True)))
        x = (columns[0] + 0.5) * COARSE - 0.5
        y = (rows[0] + 0.5) * COARSE - 0.5
        grid = torch.stack([2 * x / (width - 1) - 1, 2 * y / (height - 1) - 1], -1)[None, None]
        seen = torch.nn.functional.grid_sample(source, grid, align_corners=True)[0, 0, 0]
        total += seen * light[:, some].sum(1)
    return total


def _spread_picture(frame: Frame, radiance: Floats, halo: bool) -> Floats:
    """The image with `COARSE` samples a pixel, spread, (height * COARSE, width * COARSE)."""
    height, width = radiance.shape
    across = _samples(frame, width)
    if halo:
        at = (np.arange(width * COARSE) + 0.5) / COARSE - 0.5
        across = across + frame.halo(torch.as_tensor(at[:, None] - np.arange(width))).numpy()
    return np.asarray(_samples(frame, height) @ radiance @ across.T)


def _samples(frame: Frame, pixels: int) -> Floats:
    """Matrix from pixels to samples of the spread light, (pixels * COARSE, pixels)."""
    at = (np.arange(pixels * COARSE) + 0.5) / COARSE - 0.5
    weights, reach = frame.spread.pixel(), frame.spread.reach
    index = np.rint((at[:, None] - np.arange(pixels)) * FINE).astype(int) + reach
    inside = (index >= 0) & (index < len(weights))
    return np.asarray(np.where(inside, weights[index.clip(0, len(weights) - 1)], 0.0))
