"""What of a plan's settings the bounds of effects grow with."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from dsl_core.model.plan import Setting
from dsl_core.model.rig import ProjectorResponse
from dsl_core.simulation.led_cycle import largest_deviation


class Demand(NamedTuple):
    """The most of any setting: the exposure (ms), and light of the projector in ms of full drive.

    ``light_ms`` is that of the LED of which an exposure catches most, ``uneven_ms`` the most by which an LED
    differs from steady light, and ``bent_ms`` from that of a projector whose light is proportional to the
    drive level.
    """

    exposure_ms: float
    light_ms: float
    uneven_ms: float
    bent_ms: float

    @classmethod
    def of(
        cls, settings: Iterable[Setting], response: ProjectorResponse, led_cycle_ms: float | None
    ) -> Demand:
        """The most of some settings; LEDs that shine steadily have no cycle."""
        each = [_of_setting(setting, response, led_cycle_ms) for setting in settings]
        return cls(*(max(values) for values in zip(*each, strict=True)))


def _of_setting(setting: Setting, response: ProjectorResponse, led_cycle_ms: float | None) -> Demand:
    exposure_ms = setting.exposure_ms
    steady_ms = exposure_ms * float(response.radiance(setting.level))
    uneven = largest_deviation(exposure_ms / led_cycle_ms) if led_cycle_ms else 0.0
    levels = np.arange(round(255 * setting.level) + 1) / 255
    bent_ms = exposure_ms * float(np.abs(levels - response.light(levels)).max())
    return Demand(exposure_ms, (1 + uneven) * steady_ms, uneven * steady_ms, (1 + uneven) * bent_ms)
