"""A scan is reconstructed again with other parameters; what cannot be done is said before it is begun."""

from __future__ import annotations

import json
import shlex
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from dsl_app.results.reconstruct_again.controller import ReconstructionController, took_s
from dsl_app.results.reconstruct_again.state import (
    Reconstructed,
    ReconstructionRequest,
    ReconstructionSource,
    ReconstructionState,
    command_of,
)

from dsl_core.cli import main
from dsl_core.evaluation.cost import COSTS_ATTRIBUTE, StageCost
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.result.result_file import load_result
from dsl_core.io.rig_file import save_rig
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.rig import Rig
from tests.app.support.compare_bench import make_result
from tests.app.support.doubles import InlineRunner, RecordingNotifier


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``small.dsl`` and ``small.zarr``; to be read only."""
    return make_result(tmp_path_factory.mktemp("finished"), "small").parent


class Bench:
    """A controller that has looked at a copy of the scan."""

    def __init__(self, finished: Path, folder: Path) -> None:
        self.folder = folder / "scans"
        shutil.copytree(finished, self.folder)
        self.library = CalibrationLibrary(folder / "library")
        self.state, self.notifier = ReconstructionState(), RecordingNotifier()
        runner = InlineRunner(self.notifier)
        self.control = ReconstructionController(self.state, runner, self.notifier, self.library)
        self.done: list[Reconstructed] = []
        self.state.done.connect(self.done.append)

    @property
    def source(self) -> ReconstructionSource:
        assert self.state.source.value is not None
        return self.state.source.value

    @property
    def rig(self) -> Rig:
        calibration = ScanReader(self.folder / "small.dsl").calibration
        assert calibration is not None
        return calibration

    def prepare(self, name: str = "small.dsl") -> None:
        self.control.prepare(self.folder / name)


@pytest.fixture
def bench(finished: Path, tmp_path: Path) -> Bench:
    made = Bench(finished, tmp_path)
    made.prepare()
    return made


@pytest.mark.slow
def test_the_result_comes_beside_the_old_one(bench: Bench) -> None:
    before = bench.folder / "small.zarr"
    kept = (before / "zarr.json").read_bytes()
    bench.control.change(start_nm=450.0, stop_nm=650.0, step_nm=20.0, solver="nearest-line")
    assert bench.control.start()
    assert bench.done == [Reconstructed(bench.folder / "small-2.zarr", before)]
    result = load_result(bench.folder / "small-2.zarr")
    assert result["wavelength_nm"].values.tolist() == [450.0 + 20 * i for i in range(11)]
    assert bool(result["reflectance_std"].isnull().all())
    assert (before / "zarr.json").read_bytes() == kept


def test_a_result_leads_to_its_scan_whatever_their_names(bench: Bench) -> None:
    (bench.folder / "small.zarr").rename(bench.folder / "mine.zarr")
    bench.prepare("mine.zarr")
    assert bench.source.session == bench.folder / "small.dsl"
    assert bench.source.before == bench.folder / "mine.zarr"
    assert bench.state.request.value.name == "small"


@pytest.mark.slow
def test_a_scan_without_result_has_nothing_to_compare_with(bench: Bench) -> None:
    shutil.rmtree(bench.folder / "small.zarr")
    bench.prepare()
    assert bench.source.before is None
    bench.control.change(spectra=False)
    assert bench.control.start()
    assert bench.done == [Reconstructed(bench.folder / "small.zarr", None)]
    assert "reflectance" not in load_result(bench.folder / "small.zarr")


@pytest.mark.slow
def test_nothing_is_replaced_unasked(bench: Bench) -> None:
    bench.control.change(name="small", spectra=False)
    assert "small.zarr already exists" in bench.state.trouble.value
    assert not bench.control.start()
    assert "already exists" in bench.notifier.told[-1][1]
    bench.control.change(replace=True)
    assert bench.control.start()
    # Nobody compares a result with itself.
    assert bench.done == [Reconstructed(bench.folder / "small.zarr", None)]


def test_what_came_meanwhile_is_not_replaced(bench: Bench) -> None:
    assert bench.state.trouble.value == ""
    (bench.folder / "small-2.zarr").mkdir()
    assert not bench.control.start()
    assert bench.done == []


@pytest.mark.parametrize(
    ("change", "trouble"),
    [
        ({"step_nm": 7.0}, "does not end on a band"),
        ({"start_nm": 660.0, "stop_nm": 430.0}, "must be above the first"),
        ({"name": " "}, "Enter a name"),
        ({"name": "a/b"}, "without slashes"),
        ({"name": "small.zarr"}, "already exists"),
    ],
)
def test_bad_requests_are_refused_with_a_sentence(
    bench: Bench, change: dict[str, object], trouble: str
) -> None:
    bench.control.change(**change)
    assert trouble in bench.state.trouble.value
    assert not bench.control.start()
    assert len(list(bench.folder.iterdir())) == 2


@pytest.mark.slow
def test_bands_do_not_matter_without_spectra(bench: Bench) -> None:
    bench.control.change(step_nm=7.0, spectra=False)
    assert bench.state.trouble.value == ""
    assert "depth only" in bench.state.cost.value
    assert bench.control.start()
    assert bench.done


def test_a_scan_without_calibration_asks_for_one(bench: Bench) -> None:
    bench.state.source.set(replace(bench.source, calibration=""))
    bench.control.change()
    assert "has no calibration" in bench.state.trouble.value
    bench.control.change(calibration="room 12")
    assert bench.state.trouble.value == ""


@pytest.mark.slow
def test_calibrations_of_the_library_and_of_files_are_used(bench: Bench) -> None:
    bench.library.store("room 12", bench.rig)
    bench.prepare()
    assert bench.source.library == ("room 12",)
    bench.control.change(calibration="room 12", spectra=False)
    assert bench.control.start()
    file = save_rig(bench.rig, bench.folder / "other.json")
    bench.control.change(calibration=str(file), name="by-file")
    assert bench.control.start()
    assert [each.result.name for each in bench.done] == ["small-2.zarr", "by-file.zarr"]


def test_what_the_calibration_lacks_is_told_and_nothing_is_left(bench: Bench) -> None:
    bench.control.change(model="hybrid")
    assert bench.control.start()
    assert "has no residual" in bench.notifier.told[-1][1]
    assert bench.done == []
    assert len(list(bench.folder.iterdir())) == 2


def test_what_is_not_a_complete_scan_is_told(bench: Bench) -> None:
    for path, sentence in ((bench.folder, "is not a scan"), (bench.folder / "gone.dsl", "moved or deleted")):
        bench.control.prepare(path)
        assert sentence in bench.notifier.told[-1][1]
    log = bench.folder / "small.dsl" / "frames.jsonl"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[:-3]))
    bench.prepare()
    assert "lacks 3 of" in bench.notifier.told[-1][1]
    shutil.rmtree(bench.folder / "small.dsl")
    bench.prepare("small.zarr")
    assert "Put it there; the examples of the program come without" in bench.notifier.told[-1][1]


def test_the_cost_is_said_in_bands_and_bytes(bench: Bench) -> None:
    assert bench.state.cost.value.startswith("47 bands · at most 1 MB")
    bench.control.change(step_nm=0.5)
    assert bench.state.cost.value.startswith("461 bands · at most 9 MB")
    stages = [StageCost("decode", 2.5, 2000, 1000), StageCost("spectra", 1.0, 3000, 1000)]
    assert took_s({COSTS_ATTRIBUTE: json.dumps([asdict(stage) for stage in stages])}) == 3.5
    assert took_s({COSTS_ATTRIBUTE: "?"}) == took_s({}) == 0.0


def test_the_command_line_does_the_same(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    bench.control.change(stop_nm=530.0, step_nm=50.0, solver="colour-basis", refine=False)
    words = shlex.split(bench.control.command_line())
    assert words[0] == "dsl-scan"
    assert main(words[1:]) == 0, capsys.readouterr().err
    result = load_result(bench.folder / "small-2.zarr")
    assert result["wavelength_nm"].values.tolist() == [430, 480, 530]


def test_the_command_line_says_all_that_differs() -> None:
    source = ReconstructionSource(Path("my scans/a.dsl"), (64, 48), "own")
    request = ReconstructionRequest(
        "b", spectra=False, calibration="room 12", override=True, device="cuda", replace=True
    )
    assert command_of(request, source) == (
        "dsl-scan reconstruct 'my scans/a.dsl' -o 'my scans/b.zarr' --depth-only --calibration 'room 12'"
        " --override-calibration --device cuda --force"
    )
    assert "--model grid --solver published" in command_of(
        ReconstructionRequest("b", model="grid", solver="published"), source
    )
