"""Veiling glare: light that the camera's lens scatters over the whole image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.sensor import bayer_channels
from dsl_core.simulation.effects.base import ExtraEffect
from dsl_core.simulation.effects.bound import EffectBound
from dsl_core.simulation.effects.limits import SLACK, Limits
from dsl_core.simulation.effects.path import Image, LightPath, Signal, Stage


@dataclass(frozen=True)
class Glare(ExtraEffect):
    """Every pixel gets a share of the mean light; that of a good lens is an assumption."""

    share: float = 0.005

    name = "glare"
    summary = "veiling glare of the camera's lens"
    ns_per_pixel = 10.0

    def parameters(self, path: LightPath) -> dict[str, str]:
        """See `Effect`."""
        return {"share": f"{self.share:g} of the mean light"}

    def bound(self, limits: Limits) -> EffectBound:
        """Its share of the mean of the most light."""
        mosaic = bayer_channels(limits.path.rig.sensor.bayer, *limits.path.truth.depth_mm.shape).ravel()
        mean = max(float(limits.total[mosaic == channel].mean()) for channel in range(3))
        return limits.of_light(SLACK * self.share * mean, f"it spreads {100 * self.share:g} % of all light")

    def stage(self, path: LightPath) -> Stage:
        """See `ExtraEffect`."""
        mosaic = bayer_channels(path.rig.sensor.bayer, *path.truth.depth_mm.shape)
        return _GlareStage(self.share, mosaic)


@dataclass(frozen=True)
class _GlareStage:
    share: float
    mosaic: NDArray[np.int64]

    def apply(self, signal: Signal, image: Image) -> Signal:
        """See `Stage`; the mean of a colour is that of the mosaic's pixels which see it."""
        colours = [self.mosaic == channel for channel in range(3)]
        planes = signal if len(signal) == 3 else np.repeat(signal, 3, 0)
        veils = [self.share * float(p[c].mean()) for p, c in zip(planes, colours, strict=True)]
        if len(signal) == 3:
            return signal + np.array(veils, np.float32)[:, None, None]
        return np.asarray(signal + np.array(veils, np.float32)[self.mosaic])

    def through(self, transmission: SpectralCurve | None) -> _GlareStage:
        """See `Stage`."""
        return self
