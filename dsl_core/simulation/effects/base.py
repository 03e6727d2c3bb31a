"""What an effect of the twin is: parameters, an upper bound, a cost, and what rendering is without it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import ClassVar

from dsl_core.simulation.effects.bound import EffectBound
from dsl_core.simulation.effects.limits import Limits
from dsl_core.simulation.effects.machine import slowness
from dsl_core.simulation.effects.path import LightPath, Stage


class Effect(ABC):
    """One thing that light or electronics do, which a scene may or may not call for.

    ``needed`` effects cannot be left out. ``ns_per_pixel`` is the CPU time of a frame on the machine of
    `machine` that grows with the image, ``ms_per_frame`` what does not.
    """

    name: str
    summary: str
    needed: ClassVar[bool] = False
    ns_per_pixel: ClassVar[float] = 0.0
    ms_per_frame: ClassVar[float] = 0.0

    @abstractmethod
    def parameters(self, path: LightPath) -> dict[str, str]:
        """What it is set to, with units, for people."""

    @abstractmethod
    def bound(self, limits: Limits) -> EffectBound:
        """The most that leaving it out changes, whatever else is left out with it."""

    @abstractmethod
    def leave_out(self, path: LightPath) -> LightPath:
        """The path without it."""

    def needs_colours(self, path: LightPath) -> bool:
        """Whether it mixes neighbouring pixels, for which every pixel is rendered in three colours."""
        return False

    def cost_s(self, limits: Limits) -> float:
        """CPU seconds of a frame with a line that it takes, beside the rendering of further colours."""
        seconds = 1e-9 * self.ns_per_pixel * self.pixels_concerned(limits) + 1e-3 * self.ms_per_frame
        return seconds * slowness()

    def pixels_concerned(self, limits: Limits) -> int:
        """Pixels for which there is something to compute."""
        return limits.pixel_count


class ExtraEffect(Effect):
    """An effect beyond the plain renderer, which has a stage of its own."""

    @abstractmethod
    def stage(self, path: LightPath) -> Stage:
        """Its rendering in a path."""

    def leave_out(self, path: LightPath) -> LightPath:
        """The path without this stage."""
        return replace(path, extras=tuple(extra for extra in path.extras if extra.name != self.name))


def with_response(path: LightPath, **update: float) -> LightPath:
    """The path with other values of the projector's response."""
    response = path.rig.projector_response.model_copy(update=update)
    return replace(path, rig=path.rig.model_copy(update={"projector_response": response}))


def with_sensor(path: LightPath, **update: float) -> LightPath:
    """The path with other values of the sensor."""
    sensor = path.rig.sensor.model_copy(update=update)
    return replace(path, rig=path.rig.model_copy(update={"sensor": sensor}))
