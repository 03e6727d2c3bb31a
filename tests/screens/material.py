"""What scenes open: campaigns, scans, results and a library, made once by the twin."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from dsl_core import pipeline
from dsl_core.devices.registry import open_rig
from dsl_core.io.result.result_file import save_result
from dsl_core.io.scan.origin import rig_notes
from dsl_core.model.presets import PRESETS
from dsl_core.resources import HOME_VARIABLE
from dsl_core.workflows import scans
from tests.cases.tiny_campaign import command_all, give

#: The rig of the scans: large enough to look at, small enough to be made while one waits.
CHART = {"scene": "color-checker", "size": "148x97"}
DONE = "made.txt"
#: Calibrations of the campaign that is half done, and the step of the next one that is captured.
HALF, BEGUN = ("selftest", "geometry"), Path("spectralon") / "emission"


@dataclass(frozen=True)
class Material:
    """Where everything is below a folder; scenes open copies of what they would change."""

    folder: Path

    @property
    def complete(self) -> Path:
        """A campaign in which everything is accepted."""
        return self.folder / "complete" / "room-12"

    @property
    def half(self) -> Path:
        """A campaign with two calibrations accepted and a third begun."""
        return self.folder / "half" / "room-12"

    @property
    def home(self) -> Path:
        """The program's folder with the library in it."""
        return self.folder / "home"

    @property
    def scans(self) -> Path:
        """The folder of ``chart.dsl`` with its result, ``chart-again.zarr`` and ``unreconstructed.dsl``."""
        return self.folder / "scans"


def make_material(folder: Path) -> Material:
    """Make what is not there yet."""
    made = Material(folder)
    if (folder / DONE).exists():
        return made
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    print(f"making what the scenes open, in {folder}", flush=True)
    _scan(made.scans, "chart", "quick")
    _scan(made.scans, "chart-again", "preview")
    (made.scans / "chart-again.dsl").rename(made.scans / "unreconstructed.dsl")
    _calibrate(made)
    (folder / DONE).write_text("Remove this folder to have all of it made again.\n")
    return made


def _scan(folder: Path, name: str, preset: str) -> None:
    folder.mkdir(exist_ok=True)
    plan = next(each.plan for each in PRESETS if each.key == preset)
    session = folder / f"{name}.dsl"
    with open_rig("twin", CHART) as rig:
        pipeline.scan(rig, pipeline.fit_plan(plan, rig), session, notes=rig_notes("twin", CHART))
    save_result(scans.reconstruct_scan(session), session.with_suffix(".zarr"))


def _calibrate(made: Material) -> None:
    made.complete.parent.mkdir()
    before = os.environ.get(HOME_VARIABLE)
    os.environ[HOME_VARIABLE] = str(made.home)
    try:
        ending = give(*(word for word in command_all(made.complete) if word != "--no-library"))
    finally:
        if before is None:
            del os.environ[HOME_VARIABLE]
        else:
            os.environ[HOME_VARIABLE] = before
    assert ending.code == 0, ending.err
    made.half.mkdir(parents=True)
    shutil.copy(made.complete / "campaign.json", made.half)
    for name in HALF:
        shutil.copy(made.complete / f"{name}.json", made.half)
        shutil.copytree(made.complete / name, made.half / name)
    shutil.copytree(made.complete / BEGUN, made.half / BEGUN)
