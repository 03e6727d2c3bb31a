"""Shots of a plan of two settings, for rules that need no picture."""

from __future__ import annotations

import numpy as np

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
from dsl_core.simulation.published_rig import published_rig

#: Shots 0 to 9 are the code, 10 white, 11 black, 12 to 15 lines; from 16 on the same at another setting.
PLAN = CapturePlan(
    camera_size_px=(32, 18),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=1.0), Setting(exposure_ms=30.0, level=0.5)),
)
SHOTS = tuple(PLAN.shots())
LINE, LATER_LINE = SHOTS[13], SHOTS[29]
WON, LOST = Contest(100, 0.9, 0.0), Contest(100, -0.9, -90.0)


def known() -> Known:
    """Nothing is known yet but plan and calibration."""
    return Known(PLAN, published_rig(), 12, "RGGB", at_the_end=False, knows_light=True)


def counts(value: int) -> Counts:
    """A picture of one value in all pixels."""
    found = np.full(32 * 18, value, np.uint16)
    found.flags.writeable = False
    return found
