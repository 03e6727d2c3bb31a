"""What a scan knows about itself: plan, rig, devices, versions, origin."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from dsl_core.devices.base import CameraInfo, DeviceRig, ProjectorInfo
from dsl_core.devices.conditions import conditions_of
from dsl_core.errors import StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.kinds import what_is_at
from dsl_core.io.patience import drive_error, says_nothing
from dsl_core.io.records import read_record
from dsl_core.model.base import Record
from dsl_core.model.conditions import differences as setting_differences
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.version import __version__

#: The note that says what was before the camera, by a rig that knows.
STANDING = "before_camera"


class Manifest(Record):
    """Written once, before the first frame; never changed afterwards."""

    schema_version: Literal[1] = 1
    created: str
    versions: dict[str, str]
    plan: CapturePlan
    rig_name: str = ""
    camera: CameraInfo | None = None
    projector: ProjectorInfo | None = None
    calibration: Rig | None = None
    notes: dict[str, str] = Field(default_factory=dict)


def describe_scan(plan: CapturePlan, rig: DeviceRig | None, notes: dict[str, str] | None = None) -> Manifest:
    """The manifest of a scan that starts now; notes of the caller come after those of the rig."""
    own = dict(notes or {})
    if rig is not None and rig.standing is not None:
        own |= {STANDING: rig.standing()}
    return Manifest(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        versions={"dsl_core": __version__, "python": platform.python_version()},
        plan=plan,
        rig_name=rig.name if rig else "",
        camera=rig.camera.info if rig else None,
        projector=rig.projector.info if rig else None,
        calibration=rig.calibration if rig else None,
        notes={**rig.notes, **own} if rig else own,
    )


def read_manifest(folder: Path) -> Manifest:
    """Load the manifest of a scan folder; raises `StoreError`."""
    try:
        is_scan = (folder / MANIFEST_NAME).exists()
    except OSError as error:
        if says_nothing(error):
            raise drive_error(folder, error) from error
        raise
    if not is_scan:
        raise StoreError(
            f"{folder} is not a scan: {what_is_at(folder)}. Give the folder of a scan (NAME.dsl)."
        )
    return read_record(folder / MANIFEST_NAME, Manifest, "Restore it from a copy.")


def refuse_other_scan(folder: Path, stored: Manifest, given: Manifest) -> None:
    """Raise `StoreError` naming every field in which a resumed scan differs from the stored one."""
    differences = list(_differences(stored.plan.model_dump(), given.plan.model_dump(), "plan"))
    for name, old, new in (
        ("camera", stored.camera, given.camera),
        ("projector", stored.projector, given.projector),
    ):
        if old and new and (old.model, old.serial) != (new.model, new.serial):
            differences.append(
                f"{name} is {old.model} {old.serial} in the scan and {new.model} {new.serial} now"
            )
    if not differences and stored.camera and stored.projector and given.camera and given.projector:
        known = conditions_of(stored.camera, stored.projector)
        differences += setting_differences(known, conditions_of(given.camera, given.projector))
    if differences:
        raise StoreError(
            f"{folder} belongs to another scan: {'; '.join(differences)}."
            " Resume with the plan and devices it was started with, or choose a new name."
        )


def _differences(old: Any, new: Any, where: str) -> Iterator[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [*old, *(k for k in new if k not in old)]:
            yield from _differences(old.get(key), new.get(key), f"{where}.{key}")
    elif isinstance(old, tuple) and isinstance(new, tuple) and len(old) == len(new):
        for i, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from _differences(a, b, f"{where}[{i}]")
    elif old != new:
        yield f"{where} is {_short(old)} in the scan and {_short(new)} now"


def _short(value: Any) -> str:
    text = "absent" if value is None else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
