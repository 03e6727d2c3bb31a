from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.controller import ResultsController
from dsl_app.results.layers import Layers, rgb_of
from dsl_app.results.state import Limits, ResultsState, ResultView, SearchMode
from dsl_app.shared.undo import UndoStack

from dsl_core.io.result.annotations_file import load_annotations
from tests.app.support.doubles import InlineRunner, RecordingNotifier
from tests.app.support.small_result import BLUE, DARK, NM, write_reference, write_small_result
from tests.io.spectra.test_reference_file import BRICK, write_library

SQUARE = ((1.5, 5.5), (6.5, 5.5), (6.5, 9.5), (1.5, 9.5))


class Bench:
    """A controller on a small result, without a window."""

    def __init__(self, path: Path) -> None:
        self.state, self.undo, self.notifier = ResultsState(), UndoStack(), RecordingNotifier()
        self.control = ResultsController(self.state, InlineRunner(), self.notifier, self.undo)
        assert self.control.open(path)

    @property
    def told(self) -> str:
        return self.notifier.told[-1][1]

    @property
    def names(self) -> list[str]:
        return [mark.name for mark in self.state.marks.value]


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(write_small_result(tmp_path))


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
    for name in ("small.dsl", "other.dsl"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "manifest.json").write_text("{}")
    bench.control.open(tmp_path / "small.dsl")
    offers = [bench.state.offer.value]
    bench.control.open(tmp_path / "other.dsl")
    assert [*offers, bench.state.offer.value] == [None, tmp_path / "other.dsl"]
    assert "reconstruct" in bench.control.command_line()
    bench.control.reconstruct()
    assert "manifest" in bench.told


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


def test_pins_and_regions_are_made_undone_and_done_again(bench: Bench) -> None:
    bench.control.marks.pin((3, 3))
    bench.control.marks.add_outline(SQUARE)
    region = bench.state.marks.value[1]
    assert (region.pixels, region.used, region.spectrum.sigmas) == (20, 20, 1.0)
    np.testing.assert_allclose(region.spectrum.mean, BLUE, atol=1e-4)
    assert bench.state.selected_mark is region
    bench.undo.undo()
    assert bench.names == ["pin 1"]
    bench.undo.redo()
    assert bench.names == ["pin 1", "region 1"]
    bench.control.marks.remove(region.key)
    bench.undo.undo()
    assert bench.state.marks.value[1] is region


def test_what_has_no_spectrum_is_not_marked(bench: Bench) -> None:
    bench.control.marks.pin(DARK)
    assert "no spectrum" in bench.told
    bench.control.marks.add_outline(((90, 90), (95, 90), (95, 95)))
    assert "No pixel" in bench.told
    assert bench.names == []


def test_marks_are_kept_beside_the_result(bench: Bench, tmp_path: Path) -> None:
    marks = bench.control.marks
    marks.pin((3, 3))
    marks.rename(bench.state.marks.value[0].key, "sky")
    mask = np.zeros((24, 36), bool)
    mask[4:8, 20:30] = True
    marks.add_pixels(mask)
    marks.add_reference(write_reference(tmp_path / "tile.csv", BLUE))
    marks.show(bench.state.marks.value[2].key, False)
    again = Bench(tmp_path / "small.zarr")
    assert again.names == ["sky", "region 1", "tile"]
    assert again.state.marks.value[1].used == 40
    assert [mark.shown for mark in again.state.marks.value] == [True, True, False]
    assert again.undo.undo_text == ""
    (tmp_path / "tile.csv").unlink()
    gone = Bench(tmp_path / "small.zarr").state.marks.value[2]
    assert (gone.name, "tile.csv" in gone.trouble) == ("tile", True)


def test_a_damaged_file_of_marks_does_not_keep_the_result_shut(tmp_path: Path) -> None:
    path = write_small_result(tmp_path)
    (tmp_path / "small.marks.json").write_text("{")
    bench = Bench(path)
    assert bench.state.result.value is not None
    assert "cannot be read" in bench.told


def test_a_file_without_spectrum_is_told(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("hello")
    assert bench.control.open(tmp_path / "a.csv")
    assert "a.csv" in bench.told


def test_looking_for_a_spectrum_finds_its_material(bench: Bench) -> None:
    bench.control.search.start(SearchMode.SPECTRUM)
    assert "Select a pin" in bench.told
    bench.control.point_at((30, 5))
    bench.control.search.start(SearchMode.SPECTRUM)
    search = bench.state.search.value
    assert search is not None
    assert search.name == "pixel 30, 5"
    assert search.found[:, 18:].all()
    assert not search.found[:, :18].any()
    bench.control.search.set_limits(2.0, 2.0)
    assert bench.state.search.value is not None
    assert bench.state.search.value.found[0].all()
    bench.control.search.set_mode(SearchMode.METAMERS)
    assert not bench.state.search.value.found.any()
    bench.control.search.clear()
    assert bench.state.search.value is None


def test_a_reference_of_part_of_the_range_is_not_looked_for(bench: Bench, tmp_path: Path) -> None:
    short = tmp_path / "short.csv"
    short.write_text("\n".join(f"{nm},{nm / 1000}" for nm in range(400, 551, 10)))
    bench.control.open(short)
    bench.control.search.start(SearchMode.SPECTRUM)
    assert "400 to 550 nm" in bench.told
    assert "430 to 660 nm" in bench.told
    assert bench.state.search.value is None


def test_the_share_found_is_of_pixels_with_a_spectrum(bench: Bench) -> None:
    bench.control.point_at((30, 5))
    bench.control.search.start(SearchMode.SPECTRUM)
    search = bench.state.search.value
    assert search is not None
    assert search.share == 18 * 24 / (36 * 24 - 1)
    nowhere = replace(search.likeness, angle_rad=np.full_like(search.likeness.angle_rad, np.nan))
    assert replace(search, likeness=nowhere).share is None


def test_another_light_changes_the_picture(bench: Bench) -> None:
    before = bench.state.picture.value
    bench.control.relight("A", adapted=False)
    after = bench.state.picture.value
    assert bench.state.light.value == "A"
    assert before is not None
    assert after is not None
    assert after[..., 0].mean() > before[..., 0].mean()


def test_export_says_what_it_wrote_and_replaces_nothing_unasked(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((3, 3))
    targets = {
        "ply": tmp_path / "a.ply",
        "csv": tmp_path / "a.csv",
        "envi": tmp_path / "a.hdr",
        "tiff": tmp_path / "a.tiff",
    }
    assert bench.control.export.taken(targets) == []
    bench.control.export.write(targets, overwrite=False)
    assert "Wrote 9 files" in bench.told
    assert len(bench.control.export.taken(targets)) == 9
    bench.control.export.write(targets, overwrite=False)
    assert "exists already" in bench.told
    bench.control.export.write(targets, overwrite=True)
    assert "Wrote 9 files" in bench.told


def test_pictures_are_exported_as_they_are_shown(bench: Bench, tmp_path: Path) -> None:
    import cv2

    bench.control.step_band(-3)
    bench.control.relight("A", adapted=False)
    bench.state.view.set(ResultView.QUALITY)
    bench.control.export.write({"png": tmp_path / "a.png"}, overwrite=False)
    files = {path.name: np.asarray(cv2.imread(str(path)))[..., ::-1] for path in tmp_path.glob("a_*.png")}
    assert set(files) == {"a_rgb_A_unadapted.png", "a_depth.png", "a_530nm.png", "a_flags.png"}
    result, picture = bench.state.result.value, bench.state.picture.value
    assert result is not None
    assert picture is not None
    lit = picture[..., 3] > 0
    np.testing.assert_array_equal(files["a_rgb_A_unadapted.png"][lit], picture[lit, :3])
    layer = Layers(result).layer(bench.state)
    assert layer is not None
    flagged = result["flags"] != 0
    assert flagged.sum() == 2
    np.testing.assert_array_equal(files["a_flags.png"][:24, :36][flagged], rgb_of(layer)[flagged])


def test_marks_on_disk_follow_undo(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((3, 3))
    assert len(load_annotations(tmp_path / "small.zarr").pins) == 1
    bench.undo.undo()
    assert load_annotations(tmp_path / "small.zarr").pins == ()


def test_spectra_carry_what_the_plot_needs(bench: Bench) -> None:
    spectrum = bench.state.spectrum_at((3, 3))
    assert spectrum is not None
    assert spectrum.nm.tolist() == NM.tolist()
    assert spectrum.std is not None
    assert spectrum.share is not None
    assert bench.state.spectrum_at(DARK) is None
    assert bench.state.spectrum_at((99, 0)) is None


def test_spectra_are_copied_and_exported_and_come_back_as_references(bench: Bench, tmp_path: Path) -> None:
    marks, copied, path = bench.control.marks, list[str](), tmp_path / "spectra.csv"
    marks.copy_spectra(copied.append)
    assert (copied, marks.can_export()) == ([], False)
    assert "No spectrum is ticked" in bench.told
    marks.add_outline(SQUARE)
    marks.pin((3, 3))
    marks.show(bench.state.marks.value[1].key, False)
    marks.copy_spectra(copied.append)
    assert "Copied 1 spectrum" in bench.told
    head, first = (line.split("\t") for line in copied[0].splitlines()[:2])
    assert head == [
        "wavelength_nm",
        "region 1: reflectance (1)",
        "region 1: deviation of its pixels (1)",
        "region 1: n (pixels)",
        "region 1: uncertainty of a pixel (1)",
    ]
    assert float(first[4]) == pytest.approx(0.01)
    marks.export_spectra(path, overwrite=False)
    assert f"Wrote 1 spectrum to {path}" in bench.told
    marks.export_spectra(path, overwrite=False)
    assert "exists already" in bench.told
    assert bench.control.open(path)
    reference = bench.state.marks.value[-1]
    assert reference.kind == "reference"
    np.testing.assert_allclose(reference.spectrum.mean, BLUE, atol=1e-4)


def test_a_library_asks_which_spectrum_and_its_name_brings_it_back(bench: Bench, tmp_path: Path) -> None:
    path = write_library(tmp_path / "plants.sli")
    assert bench.control.open(path)
    library = bench.state.library.value
    assert library is not None
    assert bench.names == []
    bench.control.marks.add_references(path, library.content.references[1:])
    assert bench.state.library.value is None
    assert bench.names == ["Brick"]
    again = Bench(tmp_path / "small.zarr")
    np.testing.assert_allclose(again.state.marks.value[0].spectrum.mean, BRICK, rtol=1e-6)
    path.with_suffix(".hdr").unlink()
    assert bench.control.open(path)
    assert "lacks its header" in bench.told


def test_limits_of_depth_are_set_refused_taken_back_and_forgotten(bench: Bench, tmp_path: Path) -> None:
    limits = bench.state.depth_limits
    found: list[Limits | None] = []
    limits.changed.connect(found.append)
    bench.control.limit_depth((705.0, 710.0))
    bench.control.limit_depth((710.0, 705.0))
    assert "no depths between 710 and 705 mm" in bench.told
    bench.control.limit_depth(None)
    bench.undo.undo()
    bench.undo.undo()
    bench.undo.redo()
    bench.control.open(tmp_path / "small.zarr")
    assert found == [(705.0, 710.0), None, (705.0, 710.0), None, (705.0, 710.0), None]
