"""What a scan costs, and what prevents it, worked out before it starts. No Qt."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from dsl_app.scan.state import Facts
from dsl_app.shared.notify import NO_RIG
from dsl_app.shared.paths import place_trouble, there
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.conditions import check_conditions
from dsl_core.errors import PlanError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.scan.estimate import estimate
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.patterns.multiplexed import profile_count
from dsl_core.words import sentence

NO_CALIBRATION = (
    "No calibration is in use. The scan can be captured, but not reconstructed without one. Calibrate the"
    " rig, or choose a calibration from the library."
)


def find_facts(
    devices: DeviceRig | None,
    plan: CapturePlan,
    target: Path,
    calibration: Rig | None,
    override: bool,
    reconstructs: bool,
) -> Facts:
    """Frames, seconds and bytes of a plan, with a sentence for each obstacle and remark.

    Where a scan ``reconstructs`` at its end, the place of its result must be free, too.
    """
    from dsl_core.capture.preflight import find_remarks

    latency_ms = 0.0 if devices is None else devices.projector.info.latency_ms
    needs = estimate(plan, target, latency_ms)
    differ = () if devices is None or calibration is None else check_conditions(calibration, devices)
    overridden = (f"Used despite different settings: {'; '.join(differ)}.",) if differ and override else ()
    is_calibrated = devices is None or calibration is not None
    has_result = reconstructs and is_calibrated
    obstacles = [*_obstacles(devices, plan, calibration, override), *_place(target, has_result)]
    if needs.free_bytes < needs.needed_bytes:
        obstacles.append("There is not enough disk space. Free some space, or choose another drive.")
    return Facts(
        needs.frames,
        needs.seconds,
        needs.needed_bytes,
        needs.free_bytes,
        tuple(obstacles),
        (*(() if is_calibrated else (NO_CALIBRATION,)), *overridden, *find_remarks(calibration)),
        bool(differ),
        is_calibrated=is_calibrated,
    )


def _obstacles(
    devices: DeviceRig | None, plan: CapturePlan, calibration: Rig | None, override: bool
) -> Iterator[str]:
    from dsl_core.capture.preflight import find_obstacles

    if devices is None:
        yield NO_RIG
        return
    try:
        profile_count(plan.spectral, plan.projector_size_px[0])
    except PlanError as error:
        yield str(error)
    if calibration is not None and override:
        calibration = calibration.model_copy(update={"conditions": None})
    for clause in find_obstacles(replace(devices, calibration=calibration), plan):
        yield sentence(clause)


def _place(target: Path, has_result: bool) -> Iterator[str]:
    result = target.with_suffix(".zarr")
    if trouble := place_trouble(target):
        yield trouble
    elif there(target / MANIFEST_NAME):
        yield f"{target.name} already contains a scan. Choose another name, or open it to resume it."
    elif there(target):
        yield f"{target} exists and is not a scan. Choose another name."
    elif has_result and there(result):
        yield (
            f"{result.name}, the result of this scan, already exists. Choose another name, or untick"
            " 'Reconstruct at the end'."
        )
