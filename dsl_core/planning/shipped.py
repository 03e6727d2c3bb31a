"""Predicts the plans of the twin for the file that comes with the program.

After a change of what is predicted: ``python -m dsl_core.planning.shipped``; a test says when.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import PRESETS, on_cycles
from dsl_core.model.rig import Rig
from dsl_core.planning.choice import candidate_plans
from dsl_core.planning.expected import Prediction
from dsl_core.planning.prediction import predict
from dsl_core.planning.samples import plane_samples
from dsl_core.planning.store import SHIPPED, plan_key, rig_stamp
from dsl_core.resources import resource_path

#: Figures beyond this many digits say nothing.
DIGITS = 6


def shipped_plans(rig: Rig) -> Iterator[CapturePlan]:
    """Presets and all that the planner considers; a plan may be there twice."""
    for preset in PRESETS:
        yield on_cycles(preset.plan, rig.frame_period_ms).sized(rig.camera, rig.projector)
    yield from candidate_plans(rig)


def write_shipped(target: Path) -> int:
    """Predict all plans of the twin as it is without options; how many there are."""
    from dsl_core.devices.registry import open_rig

    with open_rig("twin") as devices:
        rig, latency_ms = devices.calibration, devices.projector.info.latency_ms
    assert rig is not None
    view, found = plane_samples(rig), dict[str, dict[str, object]]()
    for plan in shipped_plans(rig):
        key = plan_key(plan)
        if key not in found:
            found[key] = _short(predict(rig, plan, view, latency_ms=latency_ms))
    target.write_text(json.dumps({rig_stamp(rig, latency_ms): found}, indent=0) + "\n", encoding="utf-8")
    return len(found)


def _short(found: Prediction) -> dict[str, object]:
    return {
        name: float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
        for name, value in found.model_dump().items()
    }


if __name__ == "__main__":
    print(write_shipped(resource_path(SHIPPED)), "plans are predicted.")
