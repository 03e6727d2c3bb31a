"""The one scan of a step: made or gone on with, read, and errors that name the step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from dsl_core.campaign.common.recipe import Step
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, DslError
from dsl_core.io.file_names import MANIFEST_NAME
from dsl_core.io.scan.reader import SessionReader
from dsl_core.model.plan import CapturePlan
from dsl_core.progress import Progress

SCAN_NAME = "scan.dsl"


def is_complete(folder: Path) -> bool:
    """Whether the scan in a step's folder is complete."""
    return _is_begun(folder) and not scan_of(folder).missing()


def scan_of(folder: Path) -> SessionReader:
    """The scan in a step's folder; raises `StoreError`."""
    return SessionReader(folder / SCAN_NAME)


def scan_step(
    devices: DeviceRig, folder: Path, make_plan: Callable[[], CapturePlan], progress: Progress
) -> CapturePlan:
    """Scan into a step's folder and return the plan; a scan that was begun goes on as it was planned."""
    from dsl_core import pipeline

    if _is_begun(folder):
        plan = scan_of(folder).plan
    else:
        plan = pipeline.fit_plan(make_plan(), devices)
        folder.mkdir(parents=True, exist_ok=True)
    pipeline.scan(devices, plan, folder / SCAN_NAME, progress)
    return plan


@contextmanager
def naming(step: Step) -> Iterator[None]:
    """Let errors of the block name the step."""
    try:
        yield
    except DslError as error:
        raise CalibrationError(f"{step.title}: {error}") from error


def _is_begun(folder: Path) -> bool:
    return (folder / SCAN_NAME / MANIFEST_NAME).exists()
