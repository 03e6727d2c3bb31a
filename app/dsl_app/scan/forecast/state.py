"""Predicted accuracy against time on the current rig, and what the last scan measured."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.shared.evented import Value
from dsl_core.model.plan import CapturePlan, XorCode
from dsl_core.model.presets import PRESETS

if TYPE_CHECKING:
    from dsl_core.planning.expected import Prediction

#: The preset whose plan is the published one.
PUBLISHED = "reference"
XOR_REMARK = "Figures are those of the Gray code: an XOR code alone misreads more columns."
_TITLES = {preset.key: preset.title for preset in PRESETS}


@dataclass(frozen=True)
class ForecastPoint:
    """A plan and what is expected of it; ``preset`` is its key, empty for any other plan."""

    plan: CapturePlan
    expected: Prediction
    preset: str = ""

    @cached_property
    def key(self) -> int:
        """The `identity` of its plan."""
        return identity(self.plan)

    @property
    def title(self) -> str:
        """Its displayed name."""
        return _TITLES.get(self.preset) or plan_title(self.plan)

    @property
    def remark(self) -> str:
        """What its figures leave out of this plan, in a sentence; empty for nothing."""
        return XOR_REMARK if isinstance(self.plan.code, XorCode) else ""

    @property
    def is_published(self) -> bool:
        """Whether this is the published operating point."""
        return self.preset == PUBLISHED


@dataclass(frozen=True)
class MeasuredScan:
    """Measured figures of a scan.

    Errors are None without a known truth, ``seconds`` on a rig that does not wait and of a scan that was
    resumed, and ``computing_s`` before the scan has a result. ``rmse`` and ``delta_e`` are means over
    patches, ``pixel_*`` of single pixels.
    """

    name: str
    plan: CapturePlan
    frames: int
    seconds: float | None
    rmse: float | None = None
    pixel_rmse: float | None = None
    pixel_angle_rad: float | None = None
    delta_e: float | None = None
    fwhm_nm: float | None = None
    depth_rmse_mm: float | None = None
    coverage: float | None = None
    computing_s: float | None = None


class ForecastState:
    """Values that the forecast's controller sets and its panel follows.

    ``points`` are the plans predicted so far, ``current`` is the current plan (None while unknown;
    ``trouble`` or, for this plan alone, ``refusal`` says why). ``progress`` counts plans done and in total
    (0 of 0: nothing is computed), ``left`` those that are predicted on request only. ``answer`` answers a
    budget of time or error. ``look`` is the result whose scene is planned for (None: a Color Checker),
    ``last_look`` the latest one; ``depth_mm`` is where the Color Checker would be. ``is_ready``: predictions
    need nothing but that the rig is free.
    """

    def __init__(self) -> None:
        self.points: Value[tuple[ForecastPoint, ...]] = Value(())
        self.current: Value[ForecastPoint | None] = Value(None)
        self.trouble = Value("")
        self.refusal = Value("")
        self.is_ready = Value(False)
        self.progress = Value((0, 0))
        self.left = Value(0)
        self.answer = Value("")
        self.look: Value[Path | None] = Value(None)
        self.last_look: Value[Path | None] = Value(None)
        self.depth_mm = Value(0.0)
        self.measured: Value[MeasuredScan | None] = Value(None)

    @property
    def published(self) -> ForecastPoint | None:
        """The published operating point on this rig."""
        return next((each for each in self.points.value if each.is_published), None)


def identity(plan: CapturePlan) -> int:
    """Equal for plans that differ only in name, image sizes and the rounding to whole cycles.

    A number, because custom patterns are too long to compare while a marker is dragged.
    """
    settings = tuple((round(setting.exposure_ms, 6), setting.level) for setting in plan.settings)
    return hash((plan.code, plan.spectral, settings, plan.code_settings, plan.sentinels))


def plan_title(plan: CapturePlan) -> str:
    """The name of a plan with typographic signs.

    >>> plan_title(CapturePlan(name="comb 5x2x64, 10@0.2 cycles"))
    'comb 5×2×64, 10@0.2 cycles'
    """
    return re.sub(r"(?<=\d)x(?=\d)", "×", plan.name)
