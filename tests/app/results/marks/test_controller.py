"""Pins, regions and references: added, undone, saved, copied and exported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsl_app.shared.undo import Change
from dsl_app.shell.actions import ACTIONS

from dsl_core.io.result.annotations_file import load_annotations
from tests.app.support.results_controller import SQUARE, Bench, opened
from tests.app.support.results_controller import bench as bench
from tests.app.support.small_result import BLUE, DARK, write_reference, write_small_result
from tests.io.spectra.test_reference_file import BRICK, write_library


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


def test_marks_are_removed_one_after_the_other_without_choosing_each(bench: Bench) -> None:
    marks, state = bench.control.marks, bench.state
    for column in (3, 6, 9):
        marks.pin((column, 3))
    first, second, third = (mark.key for mark in state.marks.value)
    state.selected.set(second)
    marks.remove(first)
    assert state.selected.value == second
    marks.remove(second)
    assert state.selected.value == third
    marks.remove(third)
    assert (bench.names, state.selected.value) == ([], 0)


def test_several_marks_are_removed_and_hidden_at_once(bench: Bench) -> None:
    marks, state = bench.control.marks, bench.state
    for column in (3, 6, 9, 12):
        marks.pin((column, 3))
    first, second, third, fourth = (mark.key for mark in state.marks.value)
    state.selected.set(third)
    marks.remove(second, third)
    assert (bench.names, state.selected.value) == (["pin 1", "pin 4"], fourth)
    assert bench.undo.undo_text == "removing 2 marks"
    bench.undo.undo()
    assert bench.names == ["pin 1", "pin 2", "pin 3", "pin 4"]
    marks.show(False, first, fourth)
    assert [mark.shown for mark in state.marks.value] == [False, True, True, False]
    bench.undo.undo()
    assert all(mark.shown for mark in state.marks.value)


def test_what_has_no_spectrum_is_not_marked(bench: Bench) -> None:
    bench.control.marks.pin(DARK)
    assert "no spectrum" in bench.told
    bench.control.marks.add_outline(((90, 90), (95, 90), (95, 95)))
    assert "No pixel" in bench.told
    assert bench.names == []


def test_marks_are_saved_next_to_the_result(bench: Bench, tmp_path: Path) -> None:
    marks = bench.control.marks
    marks.pin((3, 3))
    marks.rename(bench.state.marks.value[0].key, "sky")
    mask = np.zeros((24, 36), bool)
    mask[4:8, 20:30] = True
    marks.add_pixels(mask)
    marks.add_reference(write_reference(tmp_path / "tile.csv", BLUE))
    marks.show(False, bench.state.marks.value[2].key)
    again = Bench(tmp_path / "small.zarr")
    assert again.names == ["sky", "region 1", "tile"]
    assert again.state.marks.value[1].used == 40
    assert [mark.shown for mark in again.state.marks.value] == [True, True, False]
    assert again.undo.undo_text == ""
    (tmp_path / "tile.csv").unlink()
    gone = Bench(tmp_path / "small.zarr").state.marks.value[2]
    assert (gone.name, "tile.csv" in gone.trouble) == ("tile", True)


def test_a_reference_that_is_listed_is_selected_and_not_added_again(bench: Bench, tmp_path: Path) -> None:
    marks, tile = bench.control.marks, write_reference(tmp_path / "tile.csv", BLUE)
    marks.add_reference(tile)
    (listed,) = bench.state.marks.value
    marks.pin((3, 3))
    marks.add_reference(tile)
    assert bench.names == ["tile", "pin 1"]
    assert bench.state.selected_mark is listed
    assert "tile of tile.csv is listed already" in bench.told
    # The same file with other values is another reference.
    marks.add_reference(write_reference(tile, 2 * BLUE))
    assert len(bench.names) == 3


def test_a_damaged_file_of_marks_does_not_keep_the_result_shut(tmp_path: Path) -> None:
    path = write_small_result(tmp_path)
    (tmp_path / "small.marks.json").write_text("{")
    bench = Bench(path)
    assert bench.state.result.value is not None
    assert "cannot be read" in bench.told


def test_a_reference_beside_the_bands_is_told(bench: Bench, tmp_path: Path) -> None:
    rows = [f"{nm},0.5" for nm in range(1000, 1201, 10)]
    (tmp_path / "far.csv").write_text("\n".join(["nm,value", *rows]))
    bench.control.marks.add_reference(tmp_path / "far.csv")
    assert "covers 1000 to 1200 nm and the result" in bench.told
    assert len(bench.names) == 1


def test_values_without_a_unit_that_are_taken_for_percent_are_told(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.add_reference(write_reference(tmp_path / "tile.csv", 100 * BLUE))
    most = 100 * float(np.max(BLUE))
    assert f"values up to {most:.3g} are read as percent" in bench.told
    (listed,) = bench.state.marks.value
    assert listed.curve is not None
    np.testing.assert_allclose(max(listed.curve.values), np.max(BLUE), atol=1e-6)


def test_deleted_values_of_a_reference_are_told(bench: Bench, tmp_path: Path) -> None:
    values = BLUE.copy()
    values[-1] = -9999
    bench.control.marks.add_reference(write_reference(tmp_path / "tile.csv", values))
    assert "tile.csv: values below -0.9 are taken as deleted: 1." in bench.told
    (listed,) = bench.state.marks.value
    assert listed.curve is not None
    assert min(listed.curve.values) >= 0


def test_a_file_without_spectrum_is_told(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("hello")
    assert bench.control.open(tmp_path / "a.csv")
    assert "a.csv" in bench.told


def test_marks_on_disk_follow_undo(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((3, 3))
    assert len(load_annotations(tmp_path / "small.zarr").pins) == 1
    bench.undo.undo()
    assert load_annotations(tmp_path / "small.zarr").pins == ()


def test_spectra_are_copied_and_exported_and_read_again_as_references(bench: Bench, tmp_path: Path) -> None:
    marks, copied, path = bench.control.marks, list[str](), tmp_path / "spectra.csv"
    marks.copy_spectra(copied.append)
    assert (copied, marks.shown()) == ([], [])
    assert "No spectrum is ticked" in bench.told
    marks.add_outline(SQUARE)
    marks.pin((3, 3))
    marks.show(False, bench.state.marks.value[1].key)
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
    marks.export_spectra(opened(bench.state), marks.shown(), path, overwrite=False)
    assert f"Wrote 1 spectrum to {path}" in bench.told
    marks.export_spectra(opened(bench.state), marks.shown(), path, overwrite=False)
    assert "already exists" in bench.told
    marks.show(True, bench.state.marks.value[1].key)
    both = tmp_path / "both.csv"
    marks.export_spectra(opened(bench.state), marks.shown(), both, overwrite=False)
    assert "\n# pin 1: pixel at column 3, row 3, counted from 0\n" in both.read_text(encoding="utf-8")
    assert bench.control.open(path)
    reference = bench.state.marks.value[-1]
    assert reference.kind == "reference"
    np.testing.assert_allclose(reference.spectrum.mean, BLUE, atol=1e-4)


def test_a_library_asks_which_spectrum_and_its_name_finds_it_again(bench: Bench, tmp_path: Path) -> None:
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
    assert "has no header" in bench.told


def test_every_ticked_spectrum_is_copied_and_the_menu_says_so(bench: Bench) -> None:
    marks, copied = bench.control.marks, list[str]()
    for pixel in ((3, 3), (10, 3), (30, 3)):
        marks.pin(pixel)
    bench.state.selected.set(bench.state.marks.value[0].key)
    marks.show(False, bench.state.marks.value[1].key)
    marks.copy_spectra(copied.append)
    assert "Copied 2 spectra" in bench.told
    tips = {action.key: action.tip for action in ACTIONS}
    assert all(" ticked " in tips[key] for key in ("copy_spectra", "export_spectra"))


def test_what_was_done_elsewhere_can_still_be_undone_when_a_result_is_opened(
    bench: Bench, tmp_path: Path
) -> None:
    bench.undo.push(Change("position", int, int))
    bench.control.marks.pin((4, 4))
    bench.control.limit_depth((701.0, 710.0))
    assert bench.control.open(tmp_path / "small.zarr")
    assert bench.undo.undo_text == "position"
