"""A scene as the camera of a rig sees it, and as it is rendered with the requested effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from dsl_core.model.plan import CapturePlan, Setting
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.effects.base import LightPath, PatternView, make_view
from dsl_core.simulation.effects.catalogue import EXTRAS, USUAL_CHOICE, Choice, with_effects
from dsl_core.simulation.effects.demand import Demand
from dsl_core.simulation.effects.planner import EffectPlan, plan_effects
from dsl_core.simulation.effects.tolerance import ONE_DN, Tolerance
from dsl_core.simulation.foreign.rig_changes import true_rig
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.scenes.truth import Scene, SceneTruth
from dsl_core.solve.threads import one_kernel_thread

#: Light of a darkened room.
AMBIENT_DN_PER_MS = 0.002


@dataclass(frozen=True)
class Setup:
    """The devices, what is in their beams, and the room: all of a picture but scene and pattern.

    ``filter`` is in front of the camera. With ``led_cycle_ms`` the projector flashes its LEDs one after the
    other, running freely on the world's clock; None is steady light. ``device`` is what torch computes on.
    With ``foreign`` variants ``rig`` is what a calibration says, and not all that is true.
    """

    rig: Rig
    film: bool = True
    filter: SpectralCurve | None = None
    ambient_dn_per_ms: float = AMBIENT_DN_PER_MS
    led_cycle_ms: float | None = None
    defocus_px: float = 0.0
    device: str = "cpu"
    foreign: Foreign | None = None

    @cached_property
    def true_rig(self) -> Rig:
        """The rig that light really goes through."""
        return self.rig if self.foreign is None else true_rig(self.rig, self.foreign)


@dataclass(frozen=True)
class EffectRequest:
    """Which effects are rendered.

    Where the scene decides, pictures differ from those with everything by less than the ``tolerance``, for
    all patterns at the ``settings``.
    """

    choice: Choice = USUAL_CHOICE
    tolerance: Tolerance = ONE_DN
    settings: tuple[Setting, ...] = CapturePlan().settings

    def allowing(self, exposure_ms: float, level: float, setup: Setup) -> EffectRequest:
        """The same with a setting more, if effects may change more in an exposure than was allowed for."""
        if self.choice.names is not None:
            return self
        more = (*self.settings, Setting(exposure_ms=exposure_ms, level=max(level, 1 / 255)))
        response, cycle_ms = setup.true_rig.projector_response, setup.led_cycle_ms
        known, needed = (Demand.of(settings, response, cycle_ms) for settings in (self.settings, more))
        return self if needed == known else replace(self, settings=more)


class SceneInView:
    """A scene and what the camera of a rig sees of it."""

    def __init__(self, rig: Rig, scene: Scene) -> None:
        self.rig, self.scene = rig, scene

    @cached_property
    def truth(self) -> SceneTruth:
        """Depth, normals, materials and shadow."""
        return self.scene.render(self.rig.camera, self.rig.pose.projector_centre_mm)


class RenderedScene:
    """What is rendered of a scene in view, without the setup's filter; each part is made when first used."""

    def __init__(self, seen: SceneInView, setup: Setup, request: EffectRequest) -> None:
        self._seen, self._setup, self._request = seen, setup, request

    @cached_property
    def path(self) -> LightPath:
        """What is rendered."""
        if self._request.choice == USUAL_CHOICE:
            return self._usual()
        names = self._request.choice.names
        if names is None:
            names = self.effect_plan().names
        return with_effects(self.everything(), names)

    def effect_plan(self, request: EffectRequest | None = None) -> EffectPlan:
        """Which effects are rendered, and why; or would be, for another ``request``."""
        request = request or self._request
        return plan_effects(self.everything(), request.tolerance, request.settings, request.choice.names)

    def everything(self) -> LightPath:
        """All that happens to light before the scene."""
        return replace(self._usual(), extras=EXTRAS)

    def _usual(self) -> LightPath:
        """What the plain renderer has."""
        seen, setup = self._seen, self._setup
        return LightPath(
            setup.true_rig, seen.scene, seen.truth, setup.film, setup.device, led_cycle_ms=setup.led_cycle_ms,
            ambient_dn_per_ms=setup.ambient_dn_per_ms, defocus_px=setup.defocus_px, foreign=setup.foreign,
        )  # fmt: skip

    @cached_property
    def _bare(self) -> PatternView:
        return make_view(self.path)

    def through(self, transmission: SpectralCurve | None) -> PatternView:
        """What the camera sees of any pattern, through a filter in front of it (None: without)."""
        with one_kernel_thread():
            return self._bare.through(transmission) if transmission else self._bare
