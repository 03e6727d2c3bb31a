"""Distortion of both lenses."""

from __future__ import annotations

from dataclasses import replace

from dsl_core.model.geometry import Lens
from dsl_core.simulation.effects.base import Effect
from dsl_core.simulation.effects.bound import EffectBound
from dsl_core.simulation.effects.limits import Limits
from dsl_core.simulation.effects.path import LightPath

_NONE = (0.0, 0.0, 0.0, 0.0, 0.0)


class Distortion(Effect):
    """Straight lines that the lenses bend; without it, both are pinholes."""

    name = "distortion"
    summary = "distortion of the lenses"

    def parameters(self, path: LightPath) -> dict[str, str]:
        """See `Effect`."""
        return {
            "camera": f"k1 {path.rig.camera.distortion[0]:g}",
            "projector": f"k1 {path.rig.projector.distortion[0]:g}",
        }

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
