from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from dsl_app.compare.pair.controller import PairController
from dsl_app.compare.pair.state import PairState
from dsl_app.compare.series.controller import SeriesController
from dsl_app.compare.series.state import SeriesKind, SeriesState
from dsl_app.results.controller import ResultsController
from dsl_app.results.state import QualityMap, ResultsState, ResultView
from dsl_app.session.parts import (
    compare_part,
    restore_comparison,
    restore_result,
    restore_scan,
    restore_series,
    results_part,
    scan_part,
    series_part,
)
from dsl_app.session.records import ScanPart, SeriesPart, Session
from dsl_app.shared.undo import UndoStack

from dsl_core.errors import DeviceError
from dsl_core.evaluation.time_sweep import FIGURES
from dsl_core.model.frames import Frame
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.support.doubles import InlineRunner, RecordingNotifier
from tests.app.support.scan_bench import make_bench
from tests.app.support.small_result import write_small_result
from tests.cases.stage_series import write_stage, write_sweep


def test_a_result_is_looked_at_as_before(tmp_path: Path) -> None:
    path = write_small_result(tmp_path)

    def opened() -> ResultsController:
        return ResultsController(ResultsState(), InlineRunner(), RecordingNotifier(), UndoStack())

    first = opened()
    assert results_part(first.state) is None
    first.open(path)
    first.step_band(-5)
    first.point_at((7, 8))
    first.marks.pin((7, 8))
    first.show(ResultView.QUALITY)
    first.state.quality.set(QualityMap.SHARE)
    first.limit_depth((705.0, 710.0))
    first.relight("A", adapted=False)
    part = results_part(first.state)
    assert part is not None
    again = opened()
    restore_result(part, again)
    assert results_part(again.state) == part
    assert [mark.pixel for mark in again.state.marks.value] == [(7, 8)]


def test_a_plan_comes_back(tmp_path: Path) -> None:
    first = make_bench(tmp_path)
    assert scan_part(first.state) is None
    first.plan()
    first.scans.plans.set_target(tmp_path / "leaf.dsl")
    first.scans.plans.set_override(True)
    first.state.meters.set(False)
    part = scan_part(first.state)
    assert part is not None
    again = make_bench(tmp_path)
    restore_scan(part, again.scans)
    assert again.state.plan.value == first.state.plan.value
    assert again.state.target.value == tmp_path / "leaf.dsl"
    assert not again.state.then_reconstruct.value
    assert not again.state.meters.value
    # Nobody overrides a check unasked.
    assert not again.state.override.value


def test_a_scan_that_the_crash_interrupted_can_be_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = make_bench(tmp_path)
    first.rig.connect(first.rig.state.choice.value)
    first.plan()
    parts: list[ScanPart | None] = []

    def crash(camera: SimCamera, timeout_ms: float = 5000.0) -> Frame:
        parts.append(scan_part(first.state))
        raise DeviceError("The power failed.")

    monkeypatch.setattr(SimCamera, "snap", crash)
    first.scans.start()
    assert parts[0] is not None
    again = make_bench(tmp_path)
    restore_scan(parts[0], again.scans)
    session = again.state.interrupted.value
    assert session is not None
    assert session.folder == tmp_path / "first.dsl"


def test_a_comparison_comes_back(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    a, b = write_small_result(tmp_path), write_small_result(tmp_path / "b")

    def compared() -> PairController:
        return PairController(PairState(), InlineRunner(), RecordingNotifier())

    first = compared()
    assert compare_part(first.state) is None
    first.open(a)
    first.open(b)
    part = compare_part(first.state)
    assert part is not None
    again = compared()
    restore_comparison(part, again)
    assert again.state.pair.value is not None
    assert compare_part(again.state) == part


def several() -> SeriesController:
    return SeriesController(SeriesState(), InlineRunner(), RecordingNotifier(), UndoStack())


def test_a_depth_test_comes_back_with_its_positions_and_region(tmp_path: Path) -> None:
    stage = [write_stage(tmp_path, position) for position in (700.0, 725.0, 750.0)]
    first = several()
    assert series_part(first.state) is None
    first.add(stage)
    first.set_position(stage[1], 726.0)
    first.set_region((10, 6, 24, 20))
    part = series_part(first.state)
    assert part is not None
    assert Session(series=part).names == ("a series of 3 results",)
    assert Session(series=SeriesPart(rows=part.rows[:1])).names == ("a series of 1 result",)
    again = several()
    restore_series(SeriesPart.model_validate_json(part.model_dump_json()), again)
    assert series_part(again.state) == part
    assert again.state.test.value == first.state.test.value is not None


def test_a_sweep_comes_back_without_what_is_gone(tmp_path: Path) -> None:
    reference, *scans = write_sweep(tmp_path)
    first = several()
    first.ask(SeriesKind.SWEEP)
    first.add([reference, *scans])
    first.compare_with(reference)
    first.show_figure(FIGURES[1])
    part = series_part(first.state)
    assert part is not None
    shutil.rmtree(scans[0])
    again = several()
    restore_series(part, again)
    assert [row.path for row in again.state.rows.value] == [reference, *scans[1:]]
    assert (again.state.against.value, again.state.figure.value) == (reference, FIGURES[1])
    assert scans[0].name in again._notifier.told[-1][1]  # type: ignore[attr-defined]
