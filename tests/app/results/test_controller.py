"""Opening a result and looking at it, without a window."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from dsl_app.importing.captures.fields import first_mapping
from dsl_app.results.reconstruct_again.controller import read_source
from dsl_app.results.reconstruct_again.state import ReconstructionRequest, trouble_of
from dsl_app.results.state import Limits, ResultView

from dsl_core.errors import StoreError
from dsl_core.io.result.annotations_file import load_annotations
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.pipeline import Options
from dsl_core.workflows.captures import import_pictures
from tests.app.importing.captures.small_capture import PROJECTOR, make_capture
from tests.app.support.results_controller import SQUARE, Bench, exports, opened
from tests.app.support.results_controller import bench as bench
from tests.app.support.results_controller import lacking as lacking
from tests.app.support.small_result import DARK, NM, write_small_result


def test_a_result_is_opened_with_its_picture(bench: Bench) -> None:
    result = bench.state.result.value
    assert result is not None
    assert result.shape == (24, 36)
    assert bench.state.band.value == 23
    picture = bench.state.picture.value
    assert picture is not None
    assert picture.shape == (24, 36, 4)
    assert picture[DARK[1], DARK[0], 3] == 0


def test_what_cannot_be_opened_is_told_or_left_to_others(bench: Bench, tmp_path: Path) -> None:
    assert not bench.control.open(tmp_path / "cat.jpeg")
    (tmp_path / "bad.zarr").mkdir()
    (tmp_path / "bad.zarr" / "zarr.json").write_text("{}")
    assert bench.control.open(tmp_path / "bad.zarr")
    assert "bad.zarr" in bench.told
    assert bench.state.busy.value == ""


def test_a_scan_is_offered_or_its_result_opened(bench: Bench, tmp_path: Path) -> None:
    capture = make_capture(tmp_path / "set")
    for name in ("small.dsl", "other.dsl"):
        import_pictures(capture, tmp_path / name, first_mapping(12, PROJECTOR))
    bench.control.open(tmp_path / "small.dsl")
    offers = [bench.state.offer.value]
    bench.control.open(tmp_path / "other.dsl")
    assert [*offers, bench.state.offer.value] == [None, tmp_path / "other.dsl"]
    assert "reconstruct" in bench.control.command_line()


def test_a_dot_in_the_name_of_a_scan_belongs_to_it(bench: Bench, tmp_path: Path) -> None:
    import_pictures(make_capture(tmp_path / "set"), tmp_path / "set.dsl", first_mapping(12, PROJECTOR))
    shutil.copytree(tmp_path / "small.zarr", tmp_path / "leaf 1.zarr")
    shutil.move(tmp_path / "set.dsl", tmp_path / "leaf 1.5")
    bench.control.open(tmp_path / "leaf 1.5")
    assert bench.state.offer.value == tmp_path / "leaf 1.5", "the result is that of another scan"


def test_a_scan_that_lacks_a_part_is_refused_at_once(bench: Bench, tmp_path: Path) -> None:
    capture = make_capture(tmp_path / "set")
    import_pictures(capture, tmp_path / "other.dsl", first_mapping(12, PROJECTOR))
    shutil.rmtree(tmp_path / "other.dsl" / "frames")
    assert bench.control.open(tmp_path / "other.dsl")
    assert bench.state.offer.value is None
    assert "other.dsl" in bench.told
    assert "frames" in bench.told


def test_captures_of_others_are_reconstructed_without_spectra(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    capture = make_capture(tmp_path / "set")
    import_pictures(capture, tmp_path / "set.dsl", first_mapping(12, PROJECTOR))
    asked: list[Options] = []

    def refuse(*given: object, **_: object) -> None:
        asked.extend(each for each in given if isinstance(each, Options))
        raise StoreError("Enough.")

    monkeypatch.setattr("dsl_core.workflows.scans.reconstruct_to", refuse)
    bench.control.open(tmp_path / "set.dsl")
    bench.control.reconstruct()
    assert [options.spectra for options in asked] == [False]
    source = read_source(tmp_path / "set.dsl", ())
    assert not source.has_spectra
    assert "Leave out the spectra" in trouble_of(ReconstructionRequest("a"), source)


@pytest.mark.slow
def test_depth_only_results_show_depth_and_say_why_not_more(tmp_path: Path) -> None:
    bench = Bench(write_small_result(tmp_path, spectra=False))
    assert bench.state.view.value is ResultView.DEPTH
    bench.control.show(ResultView.BAND)
    assert bench.state.view.value is ResultView.DEPTH
    assert "depth only" in bench.told
    bench.control.marks.add_outline(SQUARE)
    assert bench.names == []


def test_the_cursor_stays_in_the_picture(bench: Bench) -> None:
    bench.control.move_cursor(1, 0)
    assert bench.state.cursor.value == (19, 12)
    bench.control.move_cursor(-99, 99)
    assert bench.state.cursor.value == (0, 23)
    bench.control.point_at((99, 0))
    assert bench.state.cursor.value == (0, 23)
    bench.control.step_band(99)
    assert bench.state.band.value == 46


def test_another_light_changes_the_picture(bench: Bench) -> None:
    before = bench.state.picture.value
    bench.control.relight("A", adapted=False)
    after = bench.state.picture.value
    assert bench.state.light.value == "A"
    assert before is not None
    assert after is not None
    assert after[..., 0].mean() > before[..., 0].mean()


def test_spectra_carry_what_the_plot_needs(bench: Bench) -> None:
    spectrum = bench.state.spectrum_at((3, 3))
    assert spectrum is not None
    assert spectrum.nm.tolist() == NM.tolist()
    assert spectrum.std is not None
    assert spectrum.share is not None
    assert bench.state.spectrum_at(DARK) is None
    assert bench.state.spectrum_at((99, 0)) is None


def test_limits_of_depth_are_set_refused_taken_back_and_forgotten(bench: Bench, tmp_path: Path) -> None:
    limits = bench.state.depth_limits
    found: list[Limits | None] = []
    limits.changed.connect(found.append)
    bench.control.limit_depth((705.0, 710.0))
    bench.control.limit_depth((710.0, 705.0))
    assert "no depths between 710 and 705 mm" in bench.told
    bench.control.limit_depth((1.0, 2.0))
    assert "no depths between 1 and 2 mm. Those of the result go from 700 to " in bench.told
    bench.control.limit_depth(None)
    bench.undo.undo()
    bench.undo.undo()
    bench.undo.redo()
    bench.control.open(tmp_path / "small.zarr")
    assert found == [(705.0, 710.0), None, (705.0, 710.0), None, (705.0, 710.0), None]


def test_a_band_that_no_pixel_has_leaves_colours_under_another_light(bench: Bench, lacking: Bench) -> None:
    for each in (bench, lacking):
        each.control.relight("A", True)
    shown, wanted = lacking.state.picture.value, bench.state.picture.value
    assert shown is not None
    assert wanted is not None
    assert np.abs(shown.astype(int) - wanted).max() <= 2


def test_a_result_that_is_replaced_is_read_again_and_written_only_as_seen(
    bench: Bench, tmp_path: Path
) -> None:
    bench.control.marks.pin((3, 3))
    before, writer = opened(bench.state), exports(bench.control)
    other = load_result(before.path).load()
    other["depth_mm"] = other["depth_mm"] * 0.5
    save_result(other, before.path, overwrite=True)
    writer.write({"ply": tmp_path / "a.ply"}, overwrite=False)
    assert "was replaced after it had been opened" in bench.told
    bench.control.answers.write_report(before, None, tmp_path / "a.html")
    assert "was replaced after it had been opened" in bench.told
    bench.control.marks.pin((8, 8))
    assert "The marks are not saved" in bench.told
    assert [pin.pixel for pin in load_annotations(before.path).pins] == [(3, 3)]
    assert bench.control.export() is None
    assert "is read again" in bench.told
    assert not list(tmp_path.glob("a.*"))
    now = opened(bench.state)
    assert np.nanmean(now["depth_mm"]) == pytest.approx(0.5 * np.nanmean(before["depth_mm"]))
    exports(bench.control).write({"ply": tmp_path / "a.ply"}, overwrite=False)
    assert (tmp_path / "a.ply").exists()
