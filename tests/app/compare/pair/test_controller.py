from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsl_app.compare.pair.controller import PairController
from dsl_app.compare.pair.state import PairQuantity, PairState, pair_display

from dsl_core.io.result.result_file import load_result, save_result
from tests.app.support.compare_bench import make_result, make_variant
from tests.app.support.doubles import InlineRunner, ManualRunner, RecordingNotifier
from tests.app.support.small_result import write_small_result


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """A result of the simulated rig, one of the same size, and one of another size."""
    folder = tmp_path_factory.mktemp("results")
    chart = make_result(folder, "chart")
    return chart, make_variant(chart, "near", 3.0), write_small_result(folder)


def controller() -> tuple[PairController, RecordingNotifier]:
    notifier = RecordingNotifier()
    return PairController(PairState(), InlineRunner(), notifier), notifier


def test_two_results_fill_both_sides_and_are_compared(results: tuple[Path, Path, Path]) -> None:
    compare, _ = controller()
    assert compare.open(results[0])
    assert compare.open(results[1])
    pair = compare.state.pair.value
    assert pair is not None
    assert (pair.first.name, pair.second.name, len(pair.bands)) == ("chart", "near", 47)
    rows = {row.figure: row.value for row in pair.rows}
    first, second = (side.arrays["depth_mm"] for side in (pair.first, pair.second))
    mean_mm = float(np.nanmean(first - second))
    assert mean_mm == pytest.approx(3.0, abs=0.001)
    assert float(rows["Depth, mean difference"]) == pytest.approx(mean_mm, abs=0.001)
    assert compare.command_line() == f"dsl-scan compare {results[0]} {results[1]}"


def test_results_opened_together_follow_each_other(results: tuple[Path, Path, Path]) -> None:
    notifier, runner = RecordingNotifier(), ManualRunner()
    compare = PairController(PairState(), runner, notifier)
    assert all(compare.open(path) for path in results[:2])
    runner.run_all()
    pair = compare.state.pair.value
    assert pair is not None
    assert (pair.first.name, pair.second.name) == ("chart", "near")
    assert notifier.told == []


def test_cancelling_drops_what_waits(results: tuple[Path, Path, Path]) -> None:
    runner = ManualRunner()
    compare = PairController(PairState(), runner, RecordingNotifier())
    for path in results[:2]:
        compare.open(path)
    runner.waiting[0].cancel()
    runner.run_all()
    assert compare.state.first.value is None
    assert not compare.state.busy.value


def test_a_cancelled_comparison_says_what_to_do(results: tuple[Path, Path, Path]) -> None:
    runner = ManualRunner()
    compare = PairController(PairState(), runner, RecordingNotifier())
    for path in results[:2]:
        compare.open(path)
    runner.run_next()
    runner.run_next()
    assert runner.waiting[0].title == "Compare chart"
    runner.waiting[0].cancel()
    runner.run_all()
    assert "cancelled" in compare.state.trouble.value
    display = pair_display(compare.state)
    assert display.report.why == display.swap.why == display.hint.text == compare.state.trouble.value
    compare.open_side(results[1], second=True)
    runner.run_all()
    assert compare.state.trouble.value == ""
    assert compare.state.pair.value is not None


@pytest.mark.slow
def test_a_result_is_compared_with_the_ground_truth_of_its_scene(
    results: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    compare, notifier = controller()
    compare.use_truth()
    assert "first" in notifier.told[-1][1]
    compare.open(results[0])
    compare.use_truth()
    pair = compare.state.pair.value
    assert pair is not None
    assert any(row.figure == "Depth, RMSE per pixel" for row in pair.rows)
    depth = pair.images(PairQuantity.DEPTH, 0)
    assert depth is not None
    assert abs(np.nanmedian(depth[0] - depth[1])) < 2.0
    band = pair.images(PairQuantity.BAND, 20)
    assert band is not None
    assert np.isfinite(band[1]).any()
    assert compare.command_line() == f"dsl-scan evaluate {results[0]}"
    compare.write_report(tmp_path / "report.html")
    assert (tmp_path / "report.html").stat().st_size > 10_000
    assert "report.html" in notifier.told[-1][1]


def test_another_first_side_forgets_the_truth_of_the_old_one(results: tuple[Path, Path, Path]) -> None:
    compare, _ = controller()
    compare.open(results[0])
    compare.use_truth()
    compare.open_side(results[1], second=False)
    assert compare.state.second.value is None
    assert compare.state.pair.value is None


def test_results_of_other_sizes_are_refused_in_a_sentence(results: tuple[Path, Path, Path]) -> None:
    compare, _ = controller()
    compare.open(results[0])
    compare.open(results[2])
    assert compare.state.pair.value is None
    assert "64 × 48 and 36 × 24 pixels" in compare.state.trouble.value


def test_results_of_other_parts_of_the_picture_are_refused(
    results: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    compare, _ = controller()
    whole = load_result(results[0])
    for name, left in (("left", 0), ("right", 20)):
        assert compare.open(save_result(whole.isel(x=slice(left, left + 20)), tmp_path / f"{name}.zarr"))
    assert compare.state.pair.value is None
    assert "x 0 to 19" in compare.state.trouble.value
    assert "x 20 to 39" in compare.state.trouble.value


def test_sides_change_places(results: tuple[Path, Path, Path]) -> None:
    compare, _ = controller()
    compare.open(results[0])
    compare.open(results[1])
    compare.swap()
    pair = compare.state.pair.value
    assert pair is not None
    assert (pair.first.name, pair.second.name) == ("near", "chart")


def test_a_report_of_two_results_has_their_figures_and_where_they_differ(
    results: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    compare, notifier = controller()
    compare.open(results[0])
    compare.open(results[1])
    compare.write_report(tmp_path / "pair.html")
    page = (tmp_path / "pair.html").read_text(encoding="utf-8")
    for words in ("chart compared with near", "Depth, RMS difference", "Mean reflectance, A − B"):
        assert words in page
    assert page.count("data:image/png") == 4
    assert "pair.html" in notifier.told[-1][1]


def moved(path: Path, name: Path, by_mm: float) -> Path:
    """A result, saved under a name with all depths moved, over whatever has the name."""
    result = load_result(path).load()
    result["depth_mm"] = result["depth_mm"] + by_mm
    return save_result(result, name, overwrite=True)


def test_a_result_that_is_replaced_is_read_again_and_reported_only_as_seen(
    results: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    compare, notifier = controller()
    compare.open(moved(results[0], tmp_path / "again.zarr", 1.0))
    compare.open(results[0])
    assert not compare.read_again()
    before = compare.state.pair.value
    moved(results[0], tmp_path / "again.zarr", 5.0)
    compare.write_report(tmp_path / "r.html")
    assert not (tmp_path / "r.html").exists()
    assert "was replaced" in notifier.told[-1][1]
    compare.write_report(tmp_path / "r.html", before)
    assert not (tmp_path / "r.html").exists()
    assert "while you chose a file" in notifier.told[-1][1]
    pair = compare.state.pair.value
    assert pair is not None
    assert float(np.nanmean(pair.first.arrays["depth_mm"] - pair.second.arrays["depth_mm"])) > 4.9
    compare.write_report(tmp_path / "r.html")
    assert (tmp_path / "r.html").exists()


@pytest.mark.slow
def test_the_truth_of_a_replaced_result_is_read_again_with_it(
    results: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    compare, _ = controller()
    compare.open(moved(results[0], tmp_path / "again.zarr", 0.0))
    compare.use_truth()
    moved(results[0], tmp_path / "again.zarr", 5.0)
    assert compare.read_again()
    pair = compare.state.pair.value
    assert pair is not None
    assert pair.second.truth is not None
    assert np.nanmedian(pair.first.arrays["depth_mm"] - pair.second.arrays["depth_mm"]) > 3.0
    assert not compare.read_again()


def test_what_is_not_a_result_is_left_to_others(tmp_path: Path) -> None:
    compare, notifier = controller()
    assert not compare.open(tmp_path)
    compare.open_side(tmp_path, second=True)
    assert "is not a result" in notifier.told[-1][1]
    compare.write_report(tmp_path / "r.html")
    assert "needs two results" in notifier.told[-1][1]


def test_the_cursor_stays_in_the_image(results: tuple[Path, Path, Path]) -> None:
    compare, _ = controller()
    compare.open(results[0])
    compare.open(results[1])
    compare.point_at((3, 4))
    compare.point_at((64, 4))
    assert compare.state.cursor.value == (3, 4)
    compare.set_band(99)
    assert compare.state.band.value == 23
