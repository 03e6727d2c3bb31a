"""A plan that captures white again, and rasters of its frames in which later whites differ."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Sentinels, Setting

SIZE, BLACK_DN, WHITE_DN = (64, 48), 300.0, 1500.0
PLAN = CapturePlan(
    camera_size_px=SIZE,
    projector_size_px=(64, 18),
    code=GrayCode(rows=False),
    spectral=ScanLines(width_px=2, step_px=2),
    settings=(Setting(exposure_ms=10.0, level=1.0),),
    code_settings=(0,),
    sentinels=Sentinels(every=16),
)
#: Indices of the whites that are captured again.
WHITES = [s.index for s in PLAN.shots() if s.role == "sentinel" and PLAN.original(s).role == "white"]
RASTER = Raster(SIZE)


def rasters(
    light_of: Callable[[bool, bool], NDArray[np.float64] | float], since: int = 0
) -> dict[int, Counts]:
    """The raster of every shot, by index, with noise of 4 DN.

    ``light_of`` gives the light (rows, columns), DN, by whether a shot is white and whether it is a sentinel
    from the index ``since`` on.
    """
    rng, kept = np.random.default_rng(1), dict[int, Counts]()
    for shot in PLAN.shots():
        is_later = shot.role == "sentinel" and shot.index >= since
        light = light_of(PLAN.original(shot).role == "white", is_later)
        pixels = np.rint(BLACK_DN + light + rng.normal(0, 4, SIZE[::-1]))
        kept[shot.index] = RASTER.take(pixels.clip(0, 4095).astype(np.uint16))
    return kept
