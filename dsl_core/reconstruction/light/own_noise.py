"""How noisy the camera was during a scan, as pairs of its code show, where that is more than calibrated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.frames import FrameSource
from dsl_core.model.rig import Sensor
from dsl_core.optics.seen_noise import PAIRS, STATED_HOLDS, least_excess, noisier
from dsl_core.patterns.inverse_pairs import inverse_pairs
from dsl_core.reconstruction.light.setting_ratios import compared_rows

Counts = NDArray[np.uint16]


def own_noise(source: FrameSource, sensor: Sensor) -> tuple[Sensor, tuple[FitFinding, ...]]:
    """The sensor with the noise that frames show, and what was found; as it is where that holds.

    Raises what reading the frames raises.
    """
    plan = source.plan
    if not plan.code_settings:
        return sensor, ()
    setting = min(plan.code_settings)
    sets = inverse_pairs(plan.code, plan.projector_size_px)
    shots = {shot.pattern: shot for shot in plan.shots() if shot.setting == setting and shot.role == "code"}

    def seen(pattern: int) -> Counts:
        frame = source.read(shots[pattern])
        return frame[compared_rows(frame.shape[0])]

    pairs = [(seen(one), seen(other)) for one, other in (sets[0][:PAIRS] if sets else ())]
    excess = least_excess(pairs, sensor)
    return noisier(sensor, excess), () if excess == 1 else (_noisy(float(np.sqrt(excess))),)


def _noisy(times: float) -> FitFinding:
    return FitFinding.judged(
        "noise",
        "noise of the camera",
        times,
        "1",
        STATED_HOLDS,
        f"The camera is {times:.1f} times as noisy as its calibration says; deviations include that.",
        "Run the self-test with the camera's gain as it is in scans, or choose a lower gain.",
    )
