"""What the twin's camera sees of a scene for any pattern: expected signal, without noise.

A pattern that consists of a few white lines is rendered from cumulative spectra: a line lights, through
each order, the wavelengths between its two edges, so each edge is one look-up. Any other pattern is
summed over spectral slices. Both use the same correspondence and response as the solver.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.optics.sensor import bayer_channels
from dsl_core.simulation.rendering.first_orders import Runs, add_bands, by_pixel, order_light, white_runs
from dsl_core.simulation.rendering.kept_lines import KeptLines
from dsl_core.simulation.rendering.order_tables import OrderTables
from dsl_core.simulation.rendering.pattern_table import PatternTable, without_repeats
from dsl_core.simulation.rendering.shading import surface_shading
from dsl_core.simulation.rendering.spectral_tables import (
    BROAD,
    NARROW,
    NM,
    ORDERS,
    SpectralTables,
    zero_table,
)
from dsl_core.simulation.scenes.truth import Parts, SceneTruth

S = TypeVar("S")
T = TypeVar("T")
THREADS = 2
#: Patterns with more runs of lit columns than this are summed over slices; behind a filter, slices would blur
#: the narrow images of the lines.
MAX_RUNS, MAX_RUNS_FILTERED = 24, 64
#: With more runs the zero order is looked up in the pattern's table, but for the filter's narrow images.
MAX_RUNS_EXACT = 8
#: Orders are shared among threads in pictures with more light paths than this.
SHARED_FROM = 1 << 16


class _Light(NamedTuple):
    """Runs of white and a table of the pattern: of two the zero order has the table, the others the runs."""

    runs: Runs | None
    table: PatternTable | None


class Renderer:
    """Expected signal of one scene on one rig, in DN per ms above black.

    ``parts`` are what light comes from as `SceneTruth.parts` lists it, which is what they are if not given;
    ``orders`` those of the film besides the zero order.
    """

    def __init__(
        self,
        rig: Rig,
        truth: SceneTruth,
        *,
        film: bool = True,
        device: str = "cpu",
        orders: tuple[int, ...] = ORDERS,
        shaded: bool = True,
        parts: Parts | None = None,
    ) -> None:
        self.rig = self._bare = rig
        self.device = torch.device(device)
        self.shape = truth.depth_mm.shape
        pixel, material, share = truth.parts() if parts is None else parts
        self.pixels = self._tensor(pixel, torch.int64)
        depth = self._tensor(truth.depth_mm.ravel()[pixel])
        channel = bayer_channels(rig.sensor.bayer, *self.shape).ravel()[pixel]
        self.material_channel = self._tensor(material.astype(np.int64) * 3 + channel, torch.int64)
        self.shading = self._tensor(surface_shading(rig, truth, shaded).ravel()[pixel] * share)
        self.column, self.row = zero_order(rig, self.pixels, depth)
        w, h = rig.projector.width_px, rig.projector.height_px
        inside = (self.row > -0.5) & (self.row < h - 0.5) & (self.column > -1.5) & (self.column < w + 0.5)
        self.shading = self.shading * inside
        self._reflectance = truth.materials.at(NM)
        self.slicing = BROAD
        self.zero_table = zero_table(rig, self._reflectance, self.device)
        lit = self.shading > 0

        def tables(order: int) -> OrderTables:
            return OrderTables.make(rig, order, self.pixels, depth, lit, self._reflectance, BROAD)

        # The first picture of a live view waits for them.
        self.orders = _of_orders(tables, orders if film else (), len(self.pixels))
        halo = (
            rig.projector_response
            if film
            else rig.projector_response.model_copy(update={"halo_peak_per_px": 0.0})
        )
        self.response = halo
        self._white: Tensor | None = None
        self._colours: tuple[Renderer, ...] = ()
        self._lines = KeptLines()

    def through(self, transmission: SpectralCurve | None) -> Renderer:
        """The same view through a filter in front of the camera (None: without); the geometry is shared."""
        other = copy.copy(self)
        other.rig, other.slicing, other._white, other._colours = self._bare, BROAD, None, ()
        other._lines = KeptLines()
        if transmission is not None:
            passed = np.interp(NM, transmission.wavelengths_nm, transmission.values, 0.0, 0.0)
            # On the renderer's own grid, as the rig's may be too coarse for a narrow band.
            response = tuple(SpectralCurve.of(NM, curve.at(NM) * passed) for curve in self._bare.response)
            other.rig, other.slicing = self._bare.model_copy(update={"response": response}), NARROW
        other.zero_table = zero_table(other.rig, self._reflectance, self.device)
        other.orders = [replace(tables, spectra=other._spectra(tables)) for tables in self.orders]
        return other

    def _spectra(self, tables: OrderTables) -> SpectralTables:
        """An order's spectra through the filter of this view."""
        return SpectralTables.make(
            self.rig, tables.order, self._reflectance, tables.sigma_nm, self.slicing, self.device
        )

    def _tensor(self, array: NDArray[Any], dtype: torch.dtype = torch.float32) -> Tensor:
        return torch.as_tensor(np.ascontiguousarray(array), device=self.device, dtype=dtype)

    def expected(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Signal (rows, columns), DN per ms, of drive levels (height, width, 3) or (height, width)."""
        light = self._light(as_colour(image))
        if light.table is None and light.runs is not None and len(light.runs) == 1:
            return self._line(*light.runs[0])
        return self._picture(self._signal(light))

    def _line(self, start: float, stop: float, level: float) -> NDArray[np.float32]:
        """Signal of one white line, in proportion to its picture at full light, which plans ask for often."""
        response = self.rig.projector_response
        line = np.array([[start, stop, 1.0]], np.float32)
        full = self._lines.of((start, stop), lambda: self._picture(self._of_bands(line) * self.shading))
        signal = full * np.float32(response.radiance(level) - response.black_fraction)
        if response.black_fraction:
            signal += self._lines.of(None, lambda: self._picture(self._black() * self.shading))
        return signal

    def planes(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Signal as a camera without a mosaic would see it, DN per ms, shape (3, rows, columns)."""
        if not self._colours:
            self._colours = tuple(self._of_colour(channel) for channel in range(3))
        light = self._light(as_colour(image))
        return np.stack([colour._picture(colour._signal(light)) for colour in self._colours])

    def of_parts(self, image: NDArray[np.uint8]) -> Tensor:
        """Signal of every part, (parts,), DN per ms, of the same drive levels as `expected`."""
        return self._signal(self._light(as_colour(image)))

    def _of_colour(self, channel: int) -> Renderer:
        """The same view, every pixel of which sees one colour; the geometry is shared."""
        other = copy.copy(self)
        other.material_channel = self.material_channel.div(3, rounding_mode="floor") * 3 + channel
        other._white, other._colours, other._lines = None, (), KeptLines()
        return other

    def _light(self, colour: NDArray[np.uint8]) -> _Light:
        """A few bands of white, or any other pattern as a table."""
        levels = without_repeats(colour)
        runs, broad = white_runs(levels), self.slicing is BROAD
        if runs is not None and len(runs) > (MAX_RUNS if broad else MAX_RUNS_FILTERED):
            runs = None
        if runs is not None and (len(runs) <= MAX_RUNS_EXACT or not broad):
            return _Light(runs, None)
        return _Light(runs, PatternTable.of_strip(levels, colour.shape, self.response, self.device))

    def _signal(self, light: _Light) -> Tensor:
        signal = torch.zeros_like(self.column) + self._black()
        response, bands = self.rig.projector_response, np.zeros((0, 3), np.float32)
        if light.runs:
            radiance = [response.radiance(level) - response.black_fraction for *_, level in light.runs]
            bands = np.column_stack([np.asarray(light.runs)[:, :2], radiance]).astype(np.float32)
        if light.table is None:
            self._add_zero_bands(signal, bands)
        else:
            self._add_zero_table(signal, light.table)
        if light.runs is None:
            assert light.table is not None
            self._add_slices(signal, light.table)
        else:
            for tables in self.orders:
                add_bands(signal, tables, self.material_channel, bands)
        return signal * self.shading

    def _picture(self, signal: Tensor) -> NDArray[np.float32]:
        """What pixels see (rows, columns) of the signal of their parts (P,)."""
        out = torch.zeros(self.shape[0] * self.shape[1], device=self.device)
        out.index_add_(0, self.pixels, signal)
        return out.reshape(self.shape).cpu().numpy()

    def _black(self) -> Tensor | float:
        """Light of a dark projector: its black level times the signal of white."""
        black = self.rig.projector_response.black_fraction
        if black == 0:
            return 0.0
        if self._white is None:
            # As runs, which cost a fifth of slices and need none of their code for a first picture.
            self._white = self._of_bands(
                np.array([[-0.5, self.rig.projector.width_px - 0.5, 1.0]], np.float32)
            )
        return black * self._white

    def _of_bands(self, bands: NDArray[np.float32]) -> Tensor:
        """Light of white columns, (n, 3) of start, stop (px) and radiance, without that of black."""
        signal = torch.zeros_like(self.column)
        self._add_zero_bands(signal, bands)
        for tables in self.orders:
            add_bands(signal, tables, self.material_channel, bands)
        return signal

    def _add_zero_bands(self, signal: Tensor, bands: NDArray[np.float32]) -> None:
        """Add the zero order of white columns, (n, 3) of start, stop (px) and radiance."""
        zero, response = self.zero_table.sum(0), self.response
        if by_pixel(signal) and response.spread is None:
            from dsl_core.simulation.rendering.kernels import add_zero_runs

            # Not in the loops: compiling NumPy's exponential takes a tenth of the time to a first picture.
            shares = np.exp(np.float64(bands[:, 0] - bands[:, 1]) / response.halo_decay_px)
            add_zero_runs(
                signal.numpy(), self.column.numpy(), bands, shares, zero.numpy(),
                self.material_channel.numpy(), response.blur_px,
                response.halo_peak_per_px * response.halo_decay_px, response.halo_decay_px,
            )  # fmt: skip
            return
        for start, stop, radiance in bands.tolist():
            light = zero_order_profile(self.column, start, stop, response)
            signal += radiance * zero[self.material_channel] * light

    def _add_zero_table(self, signal: Tensor, table: PatternTable) -> None:
        """Add the zero order of any pattern."""
        for led, shown in enumerate(table.leds_shown):
            zero = self.zero_table[shown].sum(0)
            if not by_pixel(signal) or (table.has_rows and not table.along_rows):
                signal += zero[self.material_channel] * table.at(led, self.column, self.row)
                continue
            from dsl_core.simulation.rendering.kernels import add_zero_table

            across = np.zeros(0, np.float32) if table.across is None else table.across.numpy()
            add_zero_table(
                signal.numpy(), self.column.numpy(), self.row.numpy(), table.blurred[led, 0].numpy(), across,
                table.oversample, zero.numpy(), self.material_channel.numpy(),
            )  # fmt: skip

    def _add_slices(self, signal: Tensor, table: PatternTable) -> None:
        """Add the light of all orders of the film by slices of the spectrum."""
        orders = [tables for tables in self.orders if len(tables.active)]

        def light(tables: OrderTables) -> Tensor:
            return order_light(tables, table, self.material_channel, self.slicing)

        for tables, part in zip(orders, _of_orders(light, orders, len(signal)), strict=True):
            signal[tables.active] += part


def _of_orders(work: Callable[[T], S], orders: Sequence[T], paths: int) -> list[S]:
    """What is worked out for each order, which are independent: in large pictures cores share them."""
    if paths <= SHARED_FROM:
        return list(map(work, orders))
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(work, orders))


def as_colour(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Drive levels (height, width, 3) of an image that may be grey."""
    return image if image.ndim == 3 else np.broadcast_to(image[..., None], (*image.shape, 3))
