"""Folders of other programs are taken in; what is missing or misnamed is said before."""

from __future__ import annotations

import os
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from dsl_app.importing.controller import ImportController, import_scan
from dsl_app.importing.state import FileRow, Found, ImportRequest, ImportState, rows_of
from dsl_app.shared.jobs.base import Job
from dsl_app.shared.known_files import Kind, kind_of

from dsl_core.campaign.products import import_entry
from dsl_core.cli import main
from dsl_core.errors import Cancelled
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.published.calibration import export_calibration
from dsl_core.io.published.layout import FileRecord
from dsl_core.io.rig_file import load_rig
from dsl_core.io.scan.folder import ScanReader
from dsl_core.progress import CallbackProgress
from tests.app.importing.published_folders import Folders, make_folders
from tests.app.support.doubles import InlineRunner, RecordingNotifier
from tests.app.support.locked import lock

SHARED = Path(os.environ.get("DSL_SHARED", Path(__file__).parents[4] / "shared"))
CAPTURES = SHARED / "data"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Folders:
    """To be read only."""
    return make_folders(tmp_path_factory.mktemp("published"))


class Waiting:
    """Keeps jobs until they are told to run."""

    def __init__(self) -> None:
        self.jobs: list[Job[object]] = []

    @property
    def active(self) -> tuple[Job[object], ...]:
        return tuple(self.jobs)

    def submit(self, job: Job[object]) -> Job[object]:
        self.jobs.append(job)
        return job


class Bench:
    """A controller that imports into a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.home = folder / "home"
        self.home.mkdir()
        self.library = CalibrationLibrary(folder / "library")
        self.state, self.notifier = ImportState(), RecordingNotifier()
        self.control = ImportController(self.state, InlineRunner(self.notifier), self.notifier, self.library)
        self.done: list[Path] = []
        self.state.done.connect(self.done.append)

    @property
    def found(self) -> Found:
        assert self.state.found.value is not None
        return self.state.found.value

    @property
    def trouble(self) -> str:
        return self.state.trouble.value

    def row(self, start: str) -> FileRow:
        (found,) = [row for row in self.found.rows if row.expected.startswith(start) and row.is_odd]
        return found

    def look(self, folder: Path) -> None:
        self.control.look(folder, self.home)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


@pytest.fixture
def scene(made: Folders, tmp_path: Path) -> Path:
    """A copy to be spoilt."""
    return Path(shutil.copytree(made.scene, tmp_path / "scene"))


def test_a_dataset_becomes_a_scan_with_the_calibration_of_its_rig(bench: Bench, made: Folders) -> None:
    bench.look(made.scene)
    assert bench.found.kind == "scan"
    assert "64 x 48" in bench.trouble
    bench.control.change(base=str(made.own))
    assert bench.trouble == ""
    assert bench.control.start()
    assert bench.done == [bench.home / "scene.dsl"]
    before, after = ScanReader(made.scan), ScanReader(bench.done[0])
    for shot in after.plan.shots():
        np.testing.assert_array_equal(after.read(shot), before.read(shot))
    assert [path.name for path in bench.home.iterdir()] == ["scene.dsl"]


def test_a_calibration_becomes_a_file(bench: Bench, made: Folders) -> None:
    bench.look(made.rig)
    assert bench.found.kind == "calibration"
    assert bench.trouble == ""
    assert bench.control.start()
    assert bench.done == [bench.home / "rig.json"]
    assert load_rig(bench.done[0]).camera.width_px == 64
    bench.control.change(camera_px=(890, 580), target=bench.home / "b.json")
    assert "64 x 48" in bench.trouble
    assert not bench.control.start()


def test_calibrations_of_several_folders_are_not_versions_of_one(bench: Bench, made: Folders) -> None:
    library = CalibrationLibrary(bench.home / "library")
    for name in ("left bench", "right & bench"):
        bench.look(made.rig)
        bench.control.change(target=bench.home / f"{name}.json")
        assert bench.control.start()
        import_entry(bench.done[-1], library)
    assert library.names() == ("left bench", "right - bench")


def test_a_calibration_is_doubted_and_read_in_a_unit_as_by_the_command(
    bench: Bench, made: Folders, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = load_rig(made.own)
    there = own.pose.model_copy(update={"translation_mm": tuple((own.pose.vector_mm / 25.4).tolist())})
    export_calibration(own.model_copy(update={"pose": there}), tmp_path / "inches")
    bench.look(tmp_path / "inches")
    assert bench.trouble == ""
    assert bench.found.doubts.startswith("Check: the projector would be 2.46 mm from the camera; if lengths")
    assert bench.found.doubts.endswith("are in metres, set their unit to 1000 mm.")
    bench.control.change(unit_mm=25.4)
    assert bench.found.doubts == ""
    words = shlex.split(bench.control.command_line())
    assert main([*words[1:-3], str(tmp_path / "by command.json"), *words[-2:]]) == 0, capsys.readouterr().err
    assert bench.control.start()
    assert load_rig(tmp_path / "by command.json").name == "by command"
    for path in (*bench.done, tmp_path / "by command.json"):
        assert load_rig(path).pose.vector_mm == pytest.approx(own.pose.vector_mm)
    bench.control.change(unit_mm=0.1)
    assert "if its lengths are in metres, give --unit-mm 1000." in bench.trouble


def test_what_is_missing_or_misnamed_has_a_line_each(bench: Bench, made: Folders, scene: Path) -> None:
    lines = scene / "ldr_exposure1"
    (lines / "capture_0002.png").unlink()
    (lines / "capture_0004.png").rename(lines / "line 4.png")
    shutil.copy(lines / "capture_0000.png", lines / "white.png")
    shutil.rmtree(scene / "graycode_exposure1")
    bench.look(scene)
    bench.control.change(base=str(made.own))
    missing, misnamed = bench.row("ldr_exposure1/capture_0002"), bench.row("ldr_exposure1/capture_0004")
    assert (missing.status, missing.found, missing.count) == ("missing", "", 1)
    assert "capture it again" in missing.advice
    assert (misnamed.status, misnamed.found) == ("misnamed", "ldr_exposure1/line 4.png")
    assert "rename it to capture_0004.png" in misnamed.advice
    assert bench.row("graycode_exposure1/").status == "missing"
    assert [row.found for row in bench.found.rows if row.status == "extra"] == ["ldr_exposure1/white.png"]
    assert "frames: graycode_exposure1/" in bench.trouble
    assert not bench.control.start()
    assert list(bench.home.iterdir()) == []


def test_files_with_the_same_fate_share_a_line(bench: Bench, made: Folders) -> None:
    bench.look(made.scene)
    spectral = [row for row in bench.found.rows if row.expected.startswith("ldr_exposure1/")]
    (whole,) = spectral
    last = whole.count - 1
    assert whole.expected == f"ldr_exposure1/capture_0000.png … capture_{last:04d}.png ({whole.count})"
    many = [FileRecord(f"a/{i}.png", f"a/x{i}.png", "misnamed", f"rename it to {i}.png") for i in range(3)]
    assert rows_of(many) == (
        FileRow(
            "a/0.png … 2.png (3)", "a/x0.png … x2.png (3)", "misnamed", "rename it to 0.png (and so on)", 3
        ),
    )


def test_a_folder_of_other_images_says_what_is_wanted(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "holiday").mkdir()
    (tmp_path / "holiday" / "cat.jpeg").write_bytes(b"\xff\xd8")
    bench.look(tmp_path / "holiday")
    assert "is not a published dataset" in bench.trouble
    assert "none of the 8 entries" in bench.found.summary
    assert {row.status for row in bench.found.rows} == {"missing", "optional"}
    assert {"intensity1/", "black_exposure1/", "ldr_exposure1/"} <= {r.expected for r in bench.found.rows}
    bench.look(tmp_path / "gone")
    assert "is not a folder" in bench.notifier.told[-1][1]


def test_an_empty_folder_is_called_empty_and_says_what_is_wanted(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / ".DS_Store").touch()
    bench.look(tmp_path / "new")
    assert "is empty. Choose the folder that holds the pictures" in bench.notifier.told[-1][1]


def test_poses_of_a_board_are_not_taken_for_a_scan(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "poses" / "capture_0").mkdir(parents=True)
    (tmp_path / "poses" / "capture_0" / "graycode_00.png").write_bytes(b"")
    bench.look(tmp_path / "poses")
    assert "dsl-scan calibrate geometry" in bench.trouble


@pytest.mark.skipif(not CAPTURES.is_dir(), reason="the real captures are not here")
def test_real_captures_of_other_programs_are_told_from_scans(bench: Bench) -> None:
    bench.look(CAPTURES / "procam_checkerboard" / "half_res")
    assert "dsl-scan calibrate geometry" in bench.trouble
    bench.look(CAPTURES / "colorchecker_bandpass")
    assert "is not a published dataset" in bench.trouble
    assert not bench.control.start()


def test_nothing_is_replaced_and_names_are_free(bench: Bench, made: Folders) -> None:
    (bench.home / "rig.json").write_text("mine")
    bench.look(made.rig)
    request = bench.state.request.value
    assert request is not None
    assert request.target == bench.home / "rig-2.json"
    bench.control.rename("rig", bench.home)
    assert "rig.json already exists" in bench.trouble
    bench.control.rename(" ", bench.home)
    assert "Enter a name" in bench.trouble
    bench.control.rename("room/12.json", bench.home)
    assert bench.trouble == ""
    (bench.home / "room-12.json").write_text("came meanwhile")
    assert not bench.control.start()
    assert (bench.home / "rig.json").read_text() == "mine"


def test_a_cancelled_import_leaves_nothing(made: Folders, bench: Bench) -> None:
    progress = CallbackProgress(lambda stage, done, total: progress.token.cancel() if done == 3 else None)
    request = ImportRequest(made.scene, bench.home / "a.dsl", str(made.own))
    with pytest.raises(Cancelled):
        import_scan(request, bench.library, progress)
    assert list(bench.home.iterdir()) == []


def test_a_base_that_is_gone_is_told(bench: Bench, made: Folders, tmp_path: Path) -> None:
    bench.look(made.scene)
    bench.control.change(base=str(tmp_path / "gone.json"))
    assert "There is no file" in bench.trouble
    assert bench.state.busy.value == ""


@pytest.mark.parametrize("is_gone", [False, True])
def test_a_look_that_was_overtaken_says_nothing(made: Folders, tmp_path: Path, is_gone: bool) -> None:
    runner, state, notifier = Waiting(), ImportState(), RecordingNotifier()
    control = ImportController(state, runner, notifier, CalibrationLibrary(tmp_path / "library"))
    control.look(tmp_path / "gone" if is_gone else made.scene, tmp_path)
    control.look(made.rig, tmp_path)
    for job in reversed(runner.jobs):
        job.run()()
    assert state.found.value is not None
    assert state.found.value.folder == made.rig
    assert (state.trouble.value, notifier.told) == ("", [])


def test_the_command_line_does_the_same(
    bench: Bench, made: Folders, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bench.control.command_line() == ""
    bench.look(made.rig)
    bench.control.change(base=str(made.own), camera_px=(64, 48))
    words = shlex.split(bench.control.command_line())
    assert words[-2:] == ["--camera-size", "64x48"]
    assert main(words[1:]) == 0, capsys.readouterr().err
    assert load_rig(bench.home / "rig.json").camera.width_px == 64


def test_folders_are_known_by_their_layout(made: Folders, scene: Path, tmp_path: Path) -> None:
    assert kind_of(made.scene) is kind_of(made.rig) is Kind.PUBLISHED
    for part in ("intensity1", "black_exposure1", "graycode_exposure1"):
        shutil.rmtree(scene / part)
    (scene / "ldr_exposure1").rename(scene / "LDR exposure1")
    assert kind_of(scene) is Kind.PUBLISHED
    (tmp_path / "other" / "pictures").mkdir(parents=True)
    assert kind_of(tmp_path / "other") is Kind.UNKNOWN
    assert kind_of(made.scan) is Kind.SCAN


def test_a_folder_that_may_not_be_read_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench, locked = Bench(tmp_path), tmp_path / "locked"
    locked.mkdir()
    lock(monkeypatch, locked)
    bench.control.look(locked, bench.home)
    assert bench.notifier.told[-1] == (
        "error", f"{locked} cannot be read (Permission denied). Choose another folder."
    )  # fmt: skip


def test_a_place_that_cannot_be_is_told(bench: Bench, made: Folders) -> None:
    bench.look(made.scene)
    bench.control.change(base=str(made.own))
    for name, home, told in (
        ("first", Path("~no-such-user"), "~no-such-user is not a home folder"),
        ("ä" * 130, bench.home, "The name is too long"),
    ):
        bench.control.rename(name, home)
        assert told in bench.trouble
        assert not bench.control.start()
    bench.control.rename("first", bench.home)
    assert bench.trouble == ""
