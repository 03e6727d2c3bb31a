"""A dataset becomes a scan once: another dataset, or another calibration, never passes for it."""

from __future__ import annotations

import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import Cancelled, StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.published.dataset import export_dataset, open_dataset
from dsl_core.io.records import replace_record
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.manifest import read_manifest
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot
from dsl_core.model.rig import Rig
from dsl_core.progress import CallbackProgress
from dsl_core.workflows import exchange
from tests.cases.small_rig import small_rig

RIG = small_rig()
PLAN = CapturePlan(
    camera_size_px=(RIG.camera.width_px, RIG.camera.height_px),
    projector_size_px=(RIG.projector.width_px, RIG.projector.height_px),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=4, step_px=4, period_px=16),
    settings=(Setting(exposure_ms=10.0, level=0.4),),
    code_settings=(0,),
)


@dataclass(frozen=True)
class Even:
    """A scan of one of many even scenes: all frames differ, and their files are written quickly."""

    scene: int
    plan: CapturePlan = PLAN

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        width, height = self.plan.camera_size_px
        return np.full((height, width), 300 + 1000 * self.scene + shot.index, np.uint16)


def _dataset(folder: Path, scene: int) -> Path:
    export_dataset(Even(scene), folder, bayer=RIG.sensor.bayer, bit_depth=RIG.sensor.bit_depth)
    return folder


def _holds(session: Path, scene: int) -> bool:
    reader = ScanReader(session)
    return all(np.array_equal(reader.read(shot), Even(scene).read(shot)) for shot in PLAN.shots())


@pytest.mark.slow
def test_another_dataset_never_passes_for_the_scan_that_is_there(tmp_path: Path) -> None:
    session = tmp_path / "scan.dsl"
    # Two folders of one name, as they lie in the folders of two days.
    exchange.import_scan(_dataset(tmp_path / "monday" / "chart", 1), session, RIG)
    with pytest.raises(StoreError, match=r"does not come from the files of .*tuesday.*another name"):
        exchange.import_scan(_dataset(tmp_path / "tuesday" / "chart", 2), session, RIG)
    assert _holds(session, 1)


@pytest.mark.slow
def test_another_calibration_is_refused(tmp_path: Path) -> None:
    session, dataset = tmp_path / "scan.dsl", _dataset(tmp_path / "chart", 1)
    exchange.import_scan(dataset, session, RIG)
    other: Rig = RIG.model_copy(update={"white_scale": 2 * RIG.white_scale})
    with pytest.raises(StoreError, match="imported with another calibration"):
        exchange.import_scan(dataset, session, other)
    assert ScanReader(session).calibration == RIG


def test_an_exported_plan_has_the_exposures_in_force(tmp_path: Path) -> None:
    with ScanWriter.create(tmp_path / "scan.dsl", PLAN) as writer:
        for shot in PLAN.shots():
            writer.write(shot, Frame(Even(1).read(shot), 1.04 * shot.exposure_ms, 0.1, shot.index + 1))
    manifest = tmp_path / "scan.dsl" / MANIFEST_NAME
    known = read_manifest(tmp_path / "scan.dsl").model_copy(update={"calibration": RIG})
    replace_record(manifest, known)
    exchange.export_scan(tmp_path / "scan.dsl", tmp_path / "chart")
    (setting,) = open_dataset(tmp_path / "chart").plan.settings
    assert setting.exposure_ms == pytest.approx(10.4)


def test_a_scan_of_a_rig_is_not_gone_on_with(tmp_path: Path) -> None:
    session = tmp_path / "scan.dsl"
    ScanWriter.create(session, PLAN).close()
    with pytest.raises(StoreError, match="does not come from the files"):
        exchange.import_scan(_dataset(tmp_path / "chart", 1), session, RIG)


@pytest.mark.slow
def test_an_interrupted_import_goes_on_also_from_a_folder_that_moved(tmp_path: Path) -> None:
    session, dataset = tmp_path / "scan.dsl", _dataset(tmp_path / "chart", 1)
    progress = CallbackProgress(lambda stage, done, total: progress.token.cancel() if done == 3 else None)
    with pytest.raises(Cancelled):
        exchange.import_scan(dataset, session, RIG, progress)
    assert ScanReader(session).missing()
    moved = Path(shutil.move(dataset, tmp_path / "archive"))
    exchange.import_scan(moved, session, RIG)
    assert _holds(session, 1)


@pytest.mark.skipif(sys.platform != "linux", reason="the system has only names in UTF-8")
def test_a_dataset_whose_name_is_not_in_utf_8_is_imported(tmp_path: Path) -> None:
    session = tmp_path / "scan.dsl"
    exchange.import_scan(_dataset(tmp_path / "B\udce4ume", 1), session, RIG)
    assert read_manifest(session).notes["imported_from"] == "B\ufffdume"
