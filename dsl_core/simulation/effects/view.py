"""The picture of a path: the plain renderer's, or one that goes through the stages of further effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.sensor import bayer_channels
from dsl_core.simulation.effects.depth_of_field import DepthOfField
from dsl_core.simulation.effects.path import Image, LightPath, Signal, Stage, View
from dsl_core.simulation.rendering.renderer import Renderer


def make_view(path: LightPath) -> View:
    """What the camera sees in a path."""
    blurred = path.extra("depth-of-field")
    direct: View = (
        Renderer(
            path.rig, path.truth, film=path.film, device=path.device, orders=path.orders, shaded=path.shaded
        )
        if blurred is None
        else cast(DepthOfField, blurred).light(path)
    )
    if not path.extras:
        return direct
    mosaic = bayer_channels(path.rig.sensor.bayer, *path.truth.depth_mm.shape)
    stages = tuple(extra.stage(path) for extra in path.extras)
    return StagedView(direct, stages, mosaic, any(extra.needs_colours(path) for extra in path.extras))


@dataclass(frozen=True)
class StagedView:
    """Direct light that goes through stages; in all ``colours`` where light of neighbours is mixed."""

    direct: View
    stages: tuple[Stage, ...]
    mosaic: NDArray[np.int64]
    colours: bool

    def expected(self, image: Image) -> Signal:
        """See `View`."""
        if self.colours:
            return np.asarray(np.take_along_axis(self.planes(image), self.mosaic[None], 0)[0])
        return np.asarray(self._staged(self.direct.expected(image)[None], image)[0])

    def planes(self, image: Image) -> Signal:
        """See `View`."""
        return self._staged(self.direct.planes(image), image)

    def _staged(self, signal: Signal, image: Image) -> Signal:
        for stage in self.stages:
            signal = stage.apply(signal, image)
        return signal

    def through(self, transmission: SpectralCurve | None) -> StagedView:
        """See `View`."""
        stages = tuple(stage.through(transmission) for stage in self.stages)
        return StagedView(self.direct.through(transmission), stages, self.mosaic, self.colours)
