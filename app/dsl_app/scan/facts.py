"""What a plan will take on the rig at hand, and what keeps it from starting."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from dsl_app.scan.state import Facts
from dsl_app.shared.notify import NO_RIG
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.conditions import check_conditions
from dsl_core.errors import PlanError
from dsl_core.io.file_names import MANIFEST_NAME
from dsl_core.io.scan.estimate import estimate
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.patterns.multiplexed import profile_count

NO_CALIBRATION = (
    "No calibration is in use: the scan can be taken, but needs one to be reconstructed. Calibrate the rig,"
    " or choose one of the library."
)


def find_facts(
    devices: DeviceRig | None, plan: CapturePlan, target: Path, calibration: Rig | None, override: bool
) -> Facts:
    """Frames, seconds and bytes of a plan, with every obstacle in a sentence."""
    latency_ms = 0.0 if devices is None else devices.projector.info.latency_ms
    needs = estimate(plan, target, latency_ms)
    differ = devices is not None and calibration is not None and bool(check_conditions(calibration, devices))
    obstacles = [*_obstacles(devices, plan, calibration, override), *_place(target)]
    if needs.free_bytes < needs.needed_bytes:
        obstacles.append("The disk has too little room. Free some space, or choose another drive.")
    remarks = (NO_CALIBRATION,) if devices is not None and calibration is None else ()
    return Facts(
        needs.frames, needs.seconds, needs.needed_bytes, needs.free_bytes, tuple(obstacles), remarks, differ
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
        yield f"{clause[0].upper()}{clause[1:]}."


def _place(target: Path) -> Iterator[str]:
    try:
        if (target / MANIFEST_NAME).exists():
            yield f"{target.name} already holds a scan. Choose another name, or open it to go on with it."
        elif target.exists():
            yield f"{target} exists and is no scan. Choose another name."
    except OSError as error:
        yield f"{target} cannot be looked at ({error.strerror}). Choose another folder."
