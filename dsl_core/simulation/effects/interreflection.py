"""Interreflection: surfaces that light each other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.sensor import bayer_channels, relative_gain
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.effects.base import SLACK, ExtraEffect, Image, ImageStep, LightPath, Limits, Signal
from dsl_core.simulation.effects.patches import Patches
from dsl_core.simulation.effects.tolerance import EffectBound
from dsl_core.simulation.rendering.shading import surface_shading
from dsl_core.simulation.rendering.spectral_tables import NM
from dsl_core.simulation.scenes.truth import FINE_NM, Materials, Parts

if TYPE_CHECKING:
    from dsl_core.simulation.rendering.renderer import Renderer

Floats = NDArray[np.float64]
#: Light is followed in bands of this width, nm, and over so many reflections.
BAND_NM, BOUNCES = 25, 8
_BAND_OF = np.minimum(((NM - NM[0]) // BAND_NM).astype(int), int((NM[-1] - NM[0]) // BAND_NM) - 1)
_BANDS = int(_BAND_OF[-1]) + 1


class Interreflection(ExtraEffect):
    """Diffuse light between all surfaces that the camera sees, by radiosity over a few hundred patches.

    The light on a patch is ``E = E0 + F (rho E)`` in each band (C. M. Goral et al., SIGGRAPH 1984), with form
    factors F and what stands between. Surfaces out of the camera's view send nothing.
    """

    name = "interreflection"
    summary = "light between surfaces"
    ns_per_pixel, ms_per_frame = 25.0, 10.0

    def bound(self, limits: Limits) -> EffectBound:
        """The indirect light of a white pattern when nothing stands between surfaces."""
        most = float(limits.indirect.max())
        if most == 0:
            return limits.of_dn(0.0, "no surface in view faces another")
        share = 100 * most / max(float(limits.direct.max()), 1e-30)
        reason = f"surfaces light each other with up to {share:.2g} % of the brightest direct light"
        return limits.of_light(SLACK * (1 + limits.glare) * most, reason)

    def most_light(self, limits: Limits) -> Floats:
        """Indirect light of a white pattern, no shadow among patches, DN per ms, (rows * columns,)."""
        path = limits.path
        exchange = Exchange.of(path, see_all=True)
        flat = Materials.of({"white": np.ones(len(FINE_NM))}).at(NM)
        chain = sum(chain_response(_flat_rig(path), m, NM)[0].sum(0) for m in path.orders if path.film)
        chain = chain + (1 + limits.halo) * chain_response(_flat_rig(path), 0, NM)[0].sum(0)
        white = np.bincount(_BAND_OF, chain * flat[0], _BANDS)
        shading = _shading(path).ravel()[exchange.patches.pixels]
        light = exchange.solve(shading[:, None] * white)
        colours = (np.full(limits.pixel_count, channel) for channel in range(3))
        brightest = np.max([exchange.signal(light, colour, path.rig.response) for colour in colours], 0)
        return np.asarray(np.bincount(exchange.parts[0], brightest, limits.pixel_count), np.float64)

    def amplification(self, path: LightPath) -> float:
        """Light that a place gets from others when all are lit evenly, relative to that light."""
        exchange = Exchange.of(path, see_all=True)
        return float(exchange.solve(np.ones((len(exchange.patches.pixels), _BANDS))).max(initial=0.0))

    def step(self, path: LightPath) -> ImageStep:
        """See `ExtraEffect`."""
        return _InterreflectionStep(path, Exchange.of(path), _light_on_samples(path), path.rig.response)


def _flat_rig(path: LightPath) -> Rig:
    """The rig with an even eye: what its renderer gives is the light that arrives."""
    even = SpectralCurve.of(NM, np.ones(len(NM)))
    return path.rig.model_copy(update={"response": (even, even, even), "flat_field": None})


def _shading(path: LightPath) -> Floats:
    return surface_shading(_flat_rig(path), path.truth, path.shaded)


def _light_on_samples(path: LightPath) -> Renderer:
    """Renderer of the light in every band on every sampled pixel."""
    pixels = Patches.of(path.rig, path.truth).pixels
    bands = {f"band {k}": (k == _BAND_OF).astype(float) for k in range(_BANDS)}
    parts: Parts = (
        np.repeat(pixels, _BANDS),
        np.tile(np.arange(_BANDS, dtype=np.int32), len(pixels)),
        np.ones(len(pixels) * _BANDS),
    )
    truth = replace(path.truth, materials=Materials.of(bands), mixed=None)
    return replace(path, rig=_flat_rig(path), truth=truth).renderer(parts)


@dataclass(frozen=True)
class Exchange:
    """Patches of a path, how they light each other, and how pixels see it.

    ``factors`` (N, N); ``reflectance`` of samples (S, bands) and patches (N, bands); ``parts`` of the
    picture, with the patches ``around`` each and their ``weights``, (parts, 4), the camera's gain included.
    """

    patches: Patches
    factors: Floats
    of_samples: Floats
    of_patches: Floats
    parts: Parts
    around: NDArray[np.int64]
    weights: Floats
    reflectance: Floats

    @classmethod
    def of(cls, path: LightPath, see_all: bool = False) -> Exchange:
        """The exchange in a path; ``see_all`` ignores what stands between: quick, and never less."""
        patches = Patches.of(path.rig, path.truth)
        factors = patches.form_factors()
        if not see_all:
            factors = factors * patches.visible(factors, path.scene.surfaces)
        reflectance = path.truth.materials.at(NM)
        banded = np.stack([_band_means(row) for row in reflectance])
        of_samples = banded[path.truth.material.ravel()[patches.pixels]]
        parts = path.truth.parts()
        around, weights = patches.around(path.truth, parts)
        gain = np.broadcast_to(relative_gain(path.rig), path.truth.depth_mm.shape).ravel()[parts[0]]
        return cls(
            patches, factors, of_samples, patches.mean(of_samples), parts, around,
            weights * (gain * parts[2])[:, None], reflectance,
        )  # fmt: skip

    def solve(self, light: Floats) -> Floats:
        """Light that patches get from others, (N, bands), for that on the samples from the projector."""
        sent = self.patches.mean(self.of_samples * light)
        found = self.factors @ sent
        for _ in range(BOUNCES - 1):
            found = self.factors @ (sent + self.of_patches * found)
        return np.asarray(found)

    def signal(self, light: Floats, channel: NDArray[np.int64], response: Rgb) -> Floats:
        """What the parts send on to the camera of the light on patches (N, bands), DN per ms, (parts,).

        ``channel`` is the colour that each pixel sees, (rows * columns,).
        """
        eye = [_band_means(row * curve.at(NM)) for row in self.reflectance for curve in response]
        of_kind = light @ np.stack(eye).T
        kind = 3 * self.parts[1].astype(np.int64) + channel[self.parts[0]]
        return np.asarray((of_kind[self.around, kind[:, None]] * self.weights).sum(1))


def _band_means(values: Floats) -> Floats:
    return np.asarray(np.bincount(_BAND_OF, values, _BANDS) / np.bincount(_BAND_OF, minlength=_BANDS))


@dataclass(frozen=True)
class _InterreflectionStep(ImageStep):
    path: LightPath
    exchange: Exchange
    samples: Renderer
    response: Rgb

    def apply(self, signal: Signal, image: Image) -> Signal:
        """See `ImageStep`."""
        arrives = self.samples.of_parts(image).cpu().numpy().astype(np.float64)
        light = self.exchange.solve(arrives.reshape(-1, _BANDS))
        shape = self.path.truth.depth_mm.shape
        if len(signal) == 1:
            channels = [bayer_channels(self.path.rig.sensor.bayer, *shape).ravel()]
        else:
            channels = [np.full(shape[0] * shape[1], channel) for channel in range(3)]
        return signal + np.stack([self._plane(light, channel) for channel in channels])

    def _plane(self, light: Floats, channel: NDArray[np.int64]) -> Signal:
        parts = self.exchange.signal(light, channel, self.response)
        plane = np.bincount(self.exchange.parts[0], parts, channel.size)
        return plane.reshape(self.path.truth.depth_mm.shape).astype(np.float32)

    def through(self, transmission: SpectralCurve | None) -> _InterreflectionStep:
        """See `ImageStep`: the filter is in front of the camera, so that the light on surfaces stays."""
        red, green, blue = self.path.rig.response
        if transmission is not None:
            passed = np.interp(NM, transmission.wavelengths_nm, transmission.values, 0.0, 0.0)
            red, green, blue = (SpectralCurve.of(NM, curve.at(NM) * passed) for curve in (red, green, blue))
        return replace(self, response=(red, green, blue))
