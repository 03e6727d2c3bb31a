"""What a scan reached, from its result and the truth of its scene. No Qt."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.scan.forecast.state import Measured
from dsl_core.errors import DslError

if TYPE_CHECKING:
    from dsl_core.evaluation.summary import Evaluation


def measure(scan: Measured, result: Path) -> Measured:
    """The scan with what its reconstruction took and, where a truth is known, its errors."""
    from dsl_core.evaluation.summary import evaluate
    from dsl_core.io.result.result_file import load_result
    from dsl_core.workflows.scans import truth_of

    found = load_result(result)
    costs = json.loads(str(found.attrs.get("stage_costs", "[]")))
    known = replace(scan, computing_s=sum(float(cost["seconds"]) for cost in costs) or None)
    try:
        truth = truth_of(found)
    except DslError:  # a real rig, whose scene nobody knows
        return known
    return _with_errors(known, evaluate(found, truth))


def _with_errors(scan: Measured, found: Evaluation) -> Measured:
    if found.depth is not None:
        scan = replace(scan, depth_rmse_mm=found.depth.rmse_mm, coverage=found.depth.coverage)
    if not found.patches:
        return scan
    squares = [patch.pixel_rmse**2 for patch in found.patches]
    return replace(
        scan,
        rmse=found.mean("rmse"),
        pixel_rmse=math.sqrt(sum(squares) / len(squares)),
        angle_rad=found.mean("angle_rad"),
        pixel_angle_rad=found.mean("pixel_angle_rad"),
        delta_e=found.mean("delta_e"),
        fwhm_nm=found.mean_fwhm_nm,
    )
