"""A small scan, as far as its light is concerned, and courses and levels of light made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Sentinels, Shot
from dsl_core.reconstruction.light.course import LightCourse
from dsl_core.reconstruction.light.line_levels import LineLevels
from dsl_core.simulation.published_rig import published_rig

PLAN = CapturePlan(
    code=GrayCode(rows=False),
    spectral=ScanLines(width_px=5, step_px=10),
    projector_size_px=(60, 20),
    sentinels=Sentinels(every=8),
)
COUNT = PLAN.spectral_count


def shots_of(role: str, pattern: int) -> list[Shot]:
    return [shot for shot in PLAN.shots() if (shot.role, shot.pattern) == (role, pattern)]


def scan_of(**more: Any) -> Any:
    """A scan of the plan, as far as its light is concerned."""
    return SimpleNamespace(plan=PLAN, rig=published_rig(), ratios={}, shots_of=shots_of, **more)


def course_of(drift: float = 0.0, flicker: float = 0.0, slope: float = 0.0) -> LightCourse:
    time = np.arange(PLAN.shot_count) / (PLAN.shot_count - 1)
    return LightCourse(drift * time, np.full(len(time), 0.003), 0.02, slope, drift, 0.001, flicker, 0.001)


def levels_of(misfit: float = 0.05) -> LineLevels:
    rng = np.random.default_rng(1)
    return LineLevels(rng.normal(0, 0.05, COUNT), rng.uniform(0.004, 0.01, COUNT), misfit, 0.05)
