"""A series of results, decided without a window."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from dsl_app.compare.series.controller import SeriesController
from dsl_app.compare.series.state import SeriesKind, SeriesRow, SeriesState
from dsl_app.shared.undo import UndoStack

from dsl_core.evaluation.summary import Truth
from dsl_core.evaluation.time_sweep import SweepPoint
from dsl_core.io.result.result_file import save_result
from dsl_core.model.result import build_result
from dsl_core.progress import NoProgress
from tests.app.support.doubles import InlineRunner, ManualRunner, RecordingNotifier
from tests.cases.stage_series import NM, flat_arrays, sweep_result, write_stage, write_sweep

POSITIONS = (700.0, 725.0, 750.0, 775.0)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("stage")
    return [write_stage(folder, position, seed=i) for i, position in enumerate(POSITIONS)]


@pytest.fixture
def undo() -> UndoStack:
    return UndoStack()


@pytest.fixture
def series(undo: UndoStack) -> SeriesController:
    notifier = RecordingNotifier()
    return SeriesController(SeriesState(), InlineRunner(notifier), notifier, undo)


def told(series: SeriesController) -> str:
    assert isinstance(series._notifier, RecordingNotifier)
    return series._notifier.told[-1][1]


def told_anything(series: SeriesController) -> bool:
    assert isinstance(series._notifier, RecordingNotifier)
    return bool(series._notifier.told)


def test_a_folder_of_results_becomes_a_depth_test(series: SeriesController, stage: list[Path]) -> None:
    series.add([stage[0].parent])
    state = series.state
    assert [row.position_mm for row in state.rows.value] == list(POSITIONS)
    assert state.test.value is not None
    assert state.test.value.free.scale == pytest.approx(1.0, abs=1e-3)
    paths = " ".join(f"'{path}'" for path in stage)
    assert series.command_line() == f"dsl-scan depth-test {paths} --positions 700,725,750,775"
    series.add(stage)
    assert "already" in told(series)
    assert len(state.rows.value) == len(stage)


def test_too_few_positions_are_said(series: SeriesController, stage: list[Path]) -> None:
    series.add(stage[:2])
    assert series.state.test.value is None
    assert "there are 2" in series.state.advice.value
    assert series.command_line() == ""
    series.write_report(stage[0].parent / "none.html")
    assert "there are 2" in told(series)
    series.add([stage[0] / "nothing"])
    assert "There is no result" in told(series)


def test_a_report_is_of_the_figures_that_were_seen(series: SeriesController, tmp_path: Path) -> None:
    paths = [write_stage(tmp_path, position, seed=i) for i, position in enumerate(POSITIONS)]
    target = tmp_path / "series.html"
    series.add(paths)
    asked = series.state.reported
    series.set_position(paths[1], 730.0)
    series.write_report(target, asked)
    assert "have changed while you chose a file" in told(series)
    asked = series.state.reported
    save_result(build_result(flat_arrays(725.0, 0.4), NM, {}), paths[1], overwrite=True)
    series.write_report(target, asked)
    assert "was replaced" in told(series)
    assert not target.exists()
    series.write_report(target, series.state.reported)
    assert target.exists()


def test_positions_are_typed_and_rows_removed_and_both_come_back(
    series: SeriesController, undo: UndoStack, stage: list[Path]
) -> None:
    series.add(stage)
    series.set_position(stage[1], 730.0)
    assert series.state.test.value is not None
    assert max(np.abs(series.state.test.value.fixed.deviations_mm)) > 3
    series.remove(stage[1])
    assert series.state.test.value.fixed.worst_mm < 0.1
    undo.undo()
    assert [row.position_mm for row in series.state.rows.value] == [700.0, 730.0, 750.0, 775.0]
    undo.undo()
    assert series.state.rows.value[1].position_mm == 725.0
    series.remove(stage[0] / "unknown")
    assert "Select" in told(series)


def test_what_cannot_count_is_left_out_with_its_reason(
    series: SeriesController, stage: list[Path], tmp_path: Path
) -> None:
    arrays = flat_arrays(800.0)
    small = {name: values[..., :30] for name, values in arrays.items()}
    save_result(build_result(small, NM, {}), tmp_path / "small 800 mm.zarr")
    arrays["points_mm"] = np.full_like(arrays["points_mm"], np.nan)
    save_result(build_result(arrays, NM, {}), tmp_path / "blind 810 mm.zarr")
    save_result(build_result(flat_arrays(820.0), NM, {}), tmp_path / "somewhere.zarr")
    series.add(stage)
    series.add([tmp_path])
    reasons = {row.name: row.trouble(SeriesKind.STAGE) for row in series.state.rows.value}
    assert "has no depth" in reasons["blind 810 mm"]
    assert reasons["small 800 mm"] == "It has 30 × 36 pixels, the first result 48 × 36."
    assert reasons["somewhere"] == "Type the stage position."
    assert series.state.test.value is not None
    assert len(series.state.test.value.positions_mm) == len(stage)
    series.set_position(tmp_path / "somewhere.zarr", 820.0)
    assert len(series.state.test.value.positions_mm) == len(stage) + 1


def test_a_row_that_was_added_again_is_there_once_after_undo(
    series: SeriesController, undo: UndoStack, stage: list[Path]
) -> None:
    series.add(stage)
    series.set_position(stage[1], 725.5)
    series.remove(stage[1])
    series.add([stage[1]])
    undo.undo()
    rows = series.state.rows.value
    assert [row.path for row in rows] == stage
    assert rows[1].position_mm == 725.5
    undo.redo()
    assert [row.path for row in series.state.rows.value] == [stage[0], *stage[2:]]


def test_rows_of_another_size_count_once_the_first_is_gone(
    series: SeriesController, undo: UndoStack, stage: list[Path], tmp_path: Path
) -> None:
    small = {name: values[..., :30] for name, values in flat_arrays(800.0).items()}
    other = save_result(build_result(small, NM, {}), tmp_path / "small 800 mm.zarr")
    series.add([other])
    series.add(stage)
    refused = [bool(row.trouble(SeriesKind.STAGE)) for row in series.state.rows.value]
    assert refused == [False, *[True] * len(stage)]
    series.remove(other)
    assert series.state.test.value is not None
    assert len(series.state.counted) == len(stage)
    undo.undo()
    assert [row.path for row in series.state.counted] == [other]


def simulate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read results whose names begin with their scene, and a truth for each scene, without the twin."""
    from dsl_core.workflows import series as workflow

    def load(path: Path) -> xr.Dataset:
        return xr.Dataset(attrs={"scene": path.stem[0], "capture_seconds": 1.0})

    for name, stand_in in (
        ("load_result", load),
        ("truth_of", lambda result: Truth(np.full((2, 2), float(ord(result.attrs["scene"]))))),
        ("rig_of_notes", lambda attributes: attributes["scene"]),
        ("evaluate", lambda *_: None),
        ("point_against_truth", lambda *_: SweepPoint("", 1.0, depth_mm=0.1)),
    ):
        monkeypatch.setattr(workflow, name, stand_in)


@pytest.fixture
def scenes(series: SeriesController, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Path]:
    """Results of scenes a and c for a sweep."""
    simulate(monkeypatch)
    series.ask(SeriesKind.SWEEP)
    paths = {name: tmp_path / f"{name}.zarr" for name in ("a1", "a2", "c1", "c2")}
    for path in paths.values():
        path.mkdir()
        (path / "zarr.json").write_text("{}", encoding="utf-8")
    return paths


def counted(series: SeriesController) -> list[str]:
    return [row.name for row in series.state.counted]


def test_a_scene_is_refused_only_beside_results_of_another(
    series: SeriesController, undo: UndoStack, scenes: dict[str, Path]
) -> None:
    series.add(scenes.values())
    assert counted(series) == ["a1", "a2"]
    series.remove(scenes["a1"])
    assert counted(series) == ["a2"]
    series.remove(scenes["a2"])
    assert counted(series) == ["c1", "c2"]
    undo.undo()
    assert counted(series) == ["c1", "c2"], "scenes of those that are there count"
    assert "shows another scene" in series.state.rows.value[0].point_trouble


def test_a_sweep_keeps_its_reference_when_all_rows_are_removed_and_come_back(
    series: SeriesController, undo: UndoStack, scenes: dict[str, Path], tmp_path: Path
) -> None:
    both = [scenes["a1"], scenes["a2"]]
    series.add(both)
    for path in both:
        series.remove(path)
    undo.undo()
    undo.undo()
    assert counted(series) == ["a1", "a2"]
    series.add([scenes["c1"]])
    assert counted(series) == ["a1", "a2"]
    series.write_report(tmp_path / "sweep.html")
    assert "the truth of the twin" in (tmp_path / "sweep.html").read_text(encoding="utf-8")


def test_a_replaced_result_is_read_again(series: SeriesController, tmp_path: Path) -> None:
    path = write_stage(tmp_path, 700.0, noise_mm=0.1)
    series.add([path])
    series.set_position(path, 705.0)
    save_result(build_result(flat_arrays(700.0, 0.4), NM, {}), path, overwrite=True)
    series.add([path])
    (row,) = series.state.rows.value
    assert row.target is not None
    assert row.target.plane.rms_mm > 0.3
    assert row.position_mm == 705.0
    assert not told_anything(series)


@pytest.mark.slow
def test_a_replaced_reference_is_read_again(series: SeriesController, tmp_path: Path) -> None:
    reference, *scans = write_sweep(tmp_path)
    series.ask(SeriesKind.SWEEP)
    series.compare_with(reference)
    series.add(scans)
    before = [point.depth_mm for point in series.state.points]
    save_result(sweep_result(400.0, 3.0, 0.0), reference, overwrite=True)
    series.read_again()
    after = [point.depth_mm for point in series.state.points]
    assert len(after) == len(before) == len(scans)
    assert min(error for error in after if error is not None) > 2


def test_undo_replaces_a_row_that_differs_only_in_its_arrays(
    series: SeriesController, undo: UndoStack, stage: list[Path]
) -> None:
    series.add(stage[:1])
    series.remove(stage[0])
    series.add(stage[:1])
    undo.undo()
    assert [row.path for row in series.state.rows.value] == stage[:1]


def test_a_region_is_read_again(series: SeriesController, undo: UndoStack, stage: list[Path]) -> None:
    series.add(stage)
    series.set_region((4, 4, 36, 28))
    target = series.state.rows.value[0].target
    assert target is not None
    assert target.plane.pixels <= 36 * 28
    assert series.command_line().endswith("--region 4,4,36,28")
    undo.undo()
    assert series.state.region.value is None


@pytest.mark.slow
def test_accuracy_over_time_against_one_result(series: SeriesController, tmp_path: Path) -> None:
    reference, *scans = write_sweep(tmp_path)
    series.ask(SeriesKind.SWEEP)
    series.add([reference, *scans])
    assert "does not say with which rig" in series.state.rows.value[0].point_trouble
    series.compare_with(reference)
    assert [point.seconds for point in series.state.points] == [10.0, 30.0, 60.0]
    assert series.state.rows.value[0].point_trouble == "This is the reference."
    words = " ".join(str(path) for path in scans)
    assert series.command_line() == f"dsl-scan sweep {words} --against {reference}"
    series.write_report(tmp_path / "sweep.html")
    assert "sweep.html" in told(series)
    assert "quick" in (tmp_path / "sweep.html").read_text(encoding="utf-8")


def test_a_result_that_is_removed_while_it_is_read_is_gone(stage: list[Path]) -> None:
    runner, undo = ManualRunner(), UndoStack()
    series = SeriesController(SeriesState(), runner, RecordingNotifier(), undo)
    series.add(stage)
    series.remove(stage[0])
    runner.run_all()
    assert [row.path for row in series.state.rows.value] == stage[1:]
    assert all(row.is_read(SeriesKind.STAGE) for row in series.state.rows.value)
    assert series.state.selected.value == stage[1]
    undo.undo()
    runner.run_all()
    assert series.state.rows.value[0].target is not None


def test_results_that_come_while_one_is_read_wait_and_a_cancel_says_so(stage: list[Path]) -> None:
    runner = ManualRunner()
    series = SeriesController(SeriesState(), runner, RecordingNotifier(), UndoStack())
    series.add(stage[:2])
    series.add(stage[2:])
    assert len(runner.waiting) == 1
    series.set_position(stage[0], 701.0)
    runner.run_next()
    assert series.state.rows.value[0].position_mm == 701.0
    runner.waiting[0].cancel()
    runner.run_all()
    assert series.state.busy.value == ""
    assert [row.trouble(SeriesKind.STAGE)[:8] for row in series.state.rows.value] == ["", *["Not read"] * 3]


def test_a_reference_chosen_while_another_is_read_is_the_one_compared_with(
    series: SeriesController, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dsl_core.workflows import series as workflow

    first, second = Path("a.zarr"), Path("b.zarr")

    class Read:
        def __init__(self, path: Path, progress: Any) -> None:
            self.name = path.stem
            if path == first:
                series.state.against.set(second)

        def judge(self, path: Path, progress: Any) -> Any:
            return None

    monkeypatch.setattr(workflow, "ResultReference", Read)
    series.state.against.set(first)
    row = SeriesRow(Path("scan.zarr"))
    names = []
    for _ in range(2):
        series._compare(row, NoProgress())
        names.append(getattr(series._reference, "name", None))
    assert names == [None, "b"]
