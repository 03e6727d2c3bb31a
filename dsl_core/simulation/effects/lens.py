"""What the lenses do at every depth: distortion, uneven gain and veiling glare."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens
from dsl_core.optics.sensor import bayer_channels, relative_gain
from dsl_core.simulation.effects.base import (
    SLACK,
    Effect,
    ExtraEffect,
    Image,
    ImageStep,
    LightPath,
    Limits,
    Signal,
)
from dsl_core.simulation.effects.tolerance import EffectBound

_NONE = (0.0, 0.0, 0.0, 0.0, 0.0)


class Distortion(Effect):
    """Straight lines that the lenses bend; without it, both are pinholes."""

    name = "distortion"
    summary = "distortion of the lenses"

    def bound(self, limits: Limits) -> EffectBound:
        """A moved edge changes a pixel from black to white however little it moves."""
        if self._none(limits.path.rig.camera) and self._none(limits.path.rig.projector):
            return limits.of_dn(0.0, "the lenses have none")
        return limits.of_share(1.0, "it moves every edge in the image")

    def leave_out(self, path: LightPath) -> LightPath:
        """The path with pinholes, and the scene as they see it."""
        rig = path.rig
        if self._none(rig.camera) and self._none(rig.projector):
            return path
        camera, projector = (
            lens.model_copy(update={"distortion": _NONE}) for lens in (rig.camera, rig.projector)
        )
        truth = path.scene.render(camera, rig.pose.projector_centre_mm)
        return replace(
            path, rig=rig.model_copy(update={"camera": camera, "projector": projector}), truth=truth
        )

    def _none(self, lens: Lens) -> bool:
        return not any(lens.distortion)


class Vignetting(Effect):
    """Gain of the camera that differs from pixel to pixel."""

    name = "vignetting"
    summary = "uneven gain of the camera"
    ideal = MappingProxyType({"rig.flat_field": None})

    def bound(self, limits: Limits) -> EffectBound:
        """The largest deviation of the gain from one."""
        if limits.path.rig.flat_field is None:
            return limits.of_dn(0.0, "the camera has an even gain")
        gain = relative_gain(limits.path.rig)
        most = float(np.abs(gain - 1).max())
        return limits.of_share(most / float(gain.min()), f"gains differ from one by up to {100 * most:.2g} %")


@dataclass(frozen=True)
class Glare(ExtraEffect):
    """Every pixel gets a share of the mean light; that of a good lens is an assumption."""

    share: float = 0.005

    name = "glare"
    summary = "veiling glare of the camera's lens"
    ns_per_pixel = 10.0

    @property
    def veil(self) -> float:
        """See `ExtraEffect`."""
        return self.share

    def bound(self, limits: Limits) -> EffectBound:
        """Its share of the mean of the most light."""
        mosaic = bayer_channels(limits.path.rig.sensor.bayer, *limits.path.truth.depth_mm.shape).ravel()
        mean = max(float(limits.total[mosaic == channel].mean()) for channel in np.unique(mosaic))
        return limits.of_light(SLACK * self.share * mean, f"it spreads {100 * self.share:g} % of all light")

    def step(self, path: LightPath) -> ImageStep:
        """See `ExtraEffect`."""
        mosaic = bayer_channels(path.rig.sensor.bayer, *path.truth.depth_mm.shape)
        return _GlareStep(self.share, mosaic)


@dataclass(frozen=True)
class _GlareStep(ImageStep):
    share: float
    mosaic: NDArray[np.int64]

    def apply(self, signal: Signal, image: Image) -> Signal:
        """See `ImageStep`; the mean of a colour is that of the mosaic's pixels which see it."""
        veils = np.zeros(3, np.float32)
        for channel in np.unique(self.mosaic):
            plane = signal[channel if len(signal) == 3 else 0]
            veils[channel] = self.share * float(plane[self.mosaic == channel].mean())
        if len(signal) == 3:
            return signal + veils[:, None, None]
        return np.asarray(signal + veils[self.mosaic])
