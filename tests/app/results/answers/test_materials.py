"""Materials of a result: from marks, from a library, under limits that are changed."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dsl_app.results.answers.controller import AnswersController, Way
from dsl_app.results.answers.materials_panel import HINT, ROWS, MaterialsPanel, materials_text
from dsl_app.results.layers import materials_table, tinted_by
from dsl_app.results.state import Materials
from dsl_app.shared.theme import DARK, LIGHT
from dsl_app.shared.widgets.forms import NumberBox
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from dsl_core.analysis import classes
from dsl_core.analysis.classify import ClassMap, Limits, Measure
from tests.app.support.doubles import ManualRunner
from tests.app.support.results_bench import Bench as Window
from tests.app.support.results_bench import bench as window
from tests.app.support.results_controller import SQUARE, Bench, opened
from tests.app.support.results_controller import bench as bench
from tests.app.support.small_result import BLUE, NM, RED

__all__ = ["bench", "window"]
ANGLE = Way(Measure.ANGLE)


def _shown(bench: Bench) -> Materials:
    materials = bench.state.materials.value
    assert materials is not None
    return materials


def _library(folder: Path) -> Path:
    rows = [f"{nm},{value}" for nm, value in zip(NM, BLUE, strict=True)]
    path = folder / "bläu <b>.csv"
    path.write_text("\n".join(["wavelength_nm,reflectance", *rows]), encoding="utf-8")
    return path


def _short_library(folder: Path) -> Path:
    """A library whose only spectrum does not cover the bands."""
    path = folder / "short.csv"
    path.write_text("wavelength_nm,reflectance\n440,0.2\n460,0.2\n480,0.3\n", encoding="utf-8")
    return path


def test_marks_are_classes_and_limits_work_at_once(bench: Bench) -> None:
    bench.control.answers.from_marks(ANGLE)
    assert "Pin pixels" in bench.told
    bench.control.marks.pin((30, 5))
    bench.control.marks.add_outline(SQUARE)
    bench.control.answers.from_marks(ANGLE)
    values = _shown(bench).found.shown.values
    assert (values[:, 18:] == 1).mean() > 0.95
    assert (values[:, :18] == 2).mean() > 0.95
    bench.control.answers.set_limits(0.0, 0.1)
    assert (_shown(bench).found.shown.values[:, :18] == 3).mean() > 0.95
    bench.control.answers.clear()
    assert bench.state.materials.value is None


def test_probability_is_the_usual_way_and_a_library_gives_names(bench: Bench, tmp_path: Path) -> None:
    bench.control.answers.from_library(_library(tmp_path), Way())
    materials = _shown(bench)
    assert materials.found.scores.measure is Measure.PROBABILITY
    assert materials.found.shown.names == ("bläu <b>",)
    assert (materials.found.scores.best[:, 18:] == 0).mean() > 0.9
    assert sum(row.pixels for row in materials.found.rows) == materials.found.shown.values.size


def test_a_band_that_no_pixel_has_is_left_out_and_told(bench: Bench, tmp_path: Path) -> None:
    result = bench.state.result.value
    assert result is not None
    result.arrays["reflectance"][7] = np.nan
    bench.control.answers.from_library(_library(tmp_path), Way())
    materials = _shown(bench)
    assert (materials.found.scores.best[:, 18:] == 0).mean() > 0.9
    assert "465 nm: left out, as no pixel has a reflectance there." in materials.notes


def test_what_a_library_may_be_off_by_belongs_to_its_classes(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[float] = []
    real = classes.classes_of_library

    def told_of(library: Any, bands_nm: Any, relative_error: float = 0.0, *rest: Any) -> Any:
        told.append(relative_error)
        return real(library, bands_nm, relative_error, *rest)

    monkeypatch.setattr(classes, "classes_of_library", told_of)
    for way in (Way(), Way(library_error=0.05)):
        bench.control.answers.from_library(_library(tmp_path), way)
    assert told == [0.0, 0.05]


def test_samples_that_are_alike_are_undecided_and_one_class_by_their_name(
    bench: Bench, tmp_path: Path, qtbot: QtBot
) -> None:
    """A library of many samples of one material: the window says what to do, and lets it be done."""
    panel = MaterialsPanel(bench.state, bench.control.answers)
    qtbot.addWidget(panel)
    spectra = np.stack([NM, BLUE, BLUE * 1.001, RED, RED * 1.001], axis=1)
    rows = [",".join(f"{value:.5f}" for value in row) for row in spectra]
    path = tmp_path / "samples.csv"
    path.write_text("\n".join(["nm,blue 1,blue 2,red 1,red 2", *rows]), encoding="utf-8")
    panel.use_library(path)
    assert "undecided: classes are alike" in panel.text.text()
    panel.grouping.choose("name")
    panel.grouping.activated.emit(panel.grouping.currentIndex())
    assert _shown(bench).found.shown.names == ("blue", "red")
    assert "undecided" not in panel.text.text()


def test_points_have_the_colour_of_their_class() -> None:
    colours = np.full((3, 3), 100, np.uint8)
    table = materials_table(ClassMap(("a",), (0,), np.zeros((1, 1), np.uint8)), "dark")
    shown = tinted_by(colours, np.array([0, 1, 2], np.uint8), table)
    assert shown[0].tolist() == [100, 100, 100], "what is not judged keeps its colour"
    assert (
        np.abs(shown[1].astype(int) - table[1, :3]).max()
        < np.abs(colours[1].astype(int) - table[1, :3]).max()
    )
    assert shown.dtype == np.uint8


def test_a_library_that_does_not_fit_is_told(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "none").mkdir()
    bench.control.answers.from_library(tmp_path / "none", Way())
    assert "no reflectance spectrum" in bench.told
    assert bench.state.materials.value is None


def test_a_map_of_other_classes_never_stands_for_an_answer_that_failed(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((30, 5))
    bench.control.answers.from_marks(ANGLE)
    assert _shown(bench).name == "marks"
    bench.control.answers.from_library(_short_library(tmp_path), ANGLE)
    assert bench.state.materials.value is None
    assert bench.told.startswith("There is no map by short.csv. ")


def test_the_map_is_written(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((30, 5))
    bench.control.answers.from_marks(ANGLE)
    bench.control.answers.write(opened(bench.state), _shown(bench), tmp_path / "map.hdr")
    assert (tmp_path / "map.img").stat().st_size == _shown(bench).found.shown.values.size
    bench.control.answers.write(opened(bench.state), _shown(bench), tmp_path / "map.hdr")
    assert "already exists" in bench.told


def test_a_report_that_was_written_can_be_opened(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, files = tmp_path / "report.html", list[Path]()
    monkeypatch.setattr("dsl_core.analysis.session_report.session_content", lambda *_: None)
    monkeypatch.setattr("dsl_core.analysis.session_report.write_report", lambda *_, **__: path)
    bench.state.opened.connect(files.append)
    bench.control.answers.write_report(opened(bench.state), None, path)
    assert bench.told == "The report is saved in report.html."
    bench.notifier.offers["Open the report"]()
    assert files == [path]


def test_another_result_has_no_materials(bench: Bench) -> None:
    bench.control.marks.pin((30, 5))
    bench.control.answers.from_marks(ANGLE)
    result = bench.state.result.value
    assert result is not None
    assert bench.control.open(result.path)
    assert bench.state.materials.value is None


def test_the_panel_is_a_legend_with_areas(qtbot: QtBot, bench: Bench) -> None:
    panel = MaterialsPanel(bench.state, bench.control.answers)
    qtbot.addWidget(panel)
    panel.apply_theme(LIGHT)
    assert panel.text.text() == HINT
    bench.control.marks.pin((30, 5))
    panel.measure.setCurrentIndex(1)
    panel.measure.activated.emit(1)
    assert panel.worst.suffix() == " rad"
    assert not panel.error.isEnabled()
    panel.error.setValue(2.0)
    assert panel.way.library_error == 0.02
    panel.marks.click()
    assert panel.table.item(0, 0).text() == "pin 1"  # type: ignore[union-attr]
    assert panel.table.rowCount() == 4
    found = _shown(bench).found
    panel.worst.setValue(1.5)
    assert _shown(bench).found.limits.worst == 1.5
    assert _shown(bench).found.scores is found.scores
    assert "1 class by marks." in materials_text(_shown(bench))
    assert "By marks: spectral angle" in panel.text.toolTip()
    panel.clear.click()
    assert not panel.write.isEnabled()


def _choose_measure(panel: MaterialsPanel, measure: Measure) -> None:
    panel.measure.choose(measure)
    panel.measure.activated.emit(panel.measure.currentIndex())


def _type(box: NumberBox, text: str) -> None:
    box.setFocus()
    box.selectAll()
    QTest.keyClicks(box, text)
    box.clearFocus()


def test_limits_of_another_measure_are_for_the_next_map(qtbot: QtBot, bench: Bench) -> None:
    panel = MaterialsPanel(bench.state, bench.control.answers)
    qtbot.addWidget(panel)
    panel.show()
    for pixel in ((30, 5), (3, 3)):
        bench.control.marks.pin(pixel)
    panel.marks.click()
    by_probability = _shown(bench)
    _choose_measure(panel, Measure.ANGLE)
    _type(panel.worst, "0.3")
    panel.apply_theme(LIGHT)
    assert _shown(bench) is by_probability
    assert panel.way.measure is Measure.ANGLE
    assert panel.worst.value() == 0.3
    told = "This map is by probability, limit 0.01. The measure above is that of the next map."
    assert panel.text.text() == told, "the map would pass for one by the angle and its limit"
    _choose_measure(panel, Measure.PROBABILITY)
    assert panel.text.text() == materials_text(by_probability)
    assert panel.worst.value() == by_probability.found.limits.worst
    _choose_measure(panel, Measure.ANGLE)
    _type(panel.worst, "0.3")
    panel.marks.click()
    assert _shown(bench).found.scores.measure is Measure.ANGLE
    assert _shown(bench).found.limits == Limits(0.3, 0.1)
    # The map is of the measure now and follows what is typed to its end.
    _type(panel.worst, "0.25")
    assert _shown(bench).found.limits == Limits(0.25, 0.1)


def test_another_brightness_or_library_error_makes_the_map_again(
    qtbot: QtBot, bench: Bench, tmp_path: Path
) -> None:
    panel = MaterialsPanel(bench.state, bench.control.answers)
    qtbot.addWidget(panel)
    for pixel in ((30, 5), (3, 3)):
        bench.control.marks.pin(pixel)
    panel.marks.click()
    before = _shown(bench)
    panel.error.setValue(5.0)
    assert _shown(bench) is before, "the error is of spectra of a library"
    panel.free.click()
    assert _shown(bench).found.brightness == "free"
    assert _shown(bench).name == "marks"
    panel.use_library(_library(tmp_path))
    before = _shown(bench)
    panel.error.setValue(2.0)
    again = _shown(bench)
    assert again.name == before.name
    assert again.found.scores is not before.found.scores
    panel.free.click()
    assert _shown(bench).found.brightness == "stated"
    _choose_measure(panel, Measure.ANGLE)
    before = _shown(bench)
    panel.free.setChecked(True)
    assert _shown(bench) is before, "a map keeps its own measure"


def test_marks_that_are_not_there_leave_the_map_of_a_library_as_it_was(
    qtbot: QtBot, bench: Bench, tmp_path: Path
) -> None:
    panel = MaterialsPanel(bench.state, bench.control.answers)
    qtbot.addWidget(panel)
    panel.use_library(_library(tmp_path))
    before = _shown(bench)
    panel.use_marks()
    assert "Pin pixels" in bench.told
    assert _shown(bench) is before
    panel.error.setValue(30)
    assert _shown(bench).found.scores is not before.found.scores
    assert _shown(bench).name == before.name


def test_a_map_that_nobody_will_see_is_given_up(bench: Bench) -> None:
    runner = ManualRunner()
    answers = AnswersController(bench.state, runner, bench.notifier)
    bench.control.marks.pin((30, 5))
    for _ in range(3):
        answers.from_marks(Way())
    answers.clear()
    answers.from_marks(Way())
    assert [job.token.is_cancelled for job in runner.waiting] == [True, True, True, False]
    runner.run_all()
    assert _shown(bench).name == "marks"
    answers.clear()


@pytest.mark.parametrize("by_marks", [False, True])
def test_a_map_that_is_cancelled_leaves_what_the_one_before_is_by(
    qtbot: QtBot, bench: Bench, tmp_path: Path, by_marks: bool
) -> None:
    runner = ManualRunner()
    panel = MaterialsPanel(bench.state, AnswersController(bench.state, runner, bench.notifier))
    qtbot.addWidget(panel)
    bench.control.marks.pin((30, 5))
    panel.use_library(_library(tmp_path))
    runner.run_all()
    before = _shown(bench)
    if by_marks:
        panel.use_marks()
    else:
        panel.error.setValue(30)
    runner.waiting[0].cancel()
    runner.run_all()
    assert _shown(bench) is before
    assert panel.error.value() == 0
    panel.free.setChecked(True)
    runner.run_all()
    assert _shown(bench).name == before.name
    assert _shown(bench) is not before


def test_notes_are_two_lines_that_leave_the_legend_alone(qtbot: QtBot, bench: Bench) -> None:
    panel = MaterialsPanel(bench.state, bench.control.answers)
    qtbot.addWidget(panel)
    panel.show()
    bench.control.marks.pin((30, 5))
    room = panel.minimumSizeHint()
    panel.marks.click()
    reason = "pin 1 is left out: its reflectance of 0.15 is known to ±0.44 only and would explain others."
    for notes, told in (
        ((reason,), "1 class by marks. pin 1 is left out; point here for why."),
        ((reason,) * 6, "1 class by marks. pin 1 is left out and 5 more notes; point here for why."),
        (("marks: values up to 80 are percent.",), "1 class by marks. Values up to 80 are percent."),
        (("Two are alike.",), "1 class by marks. Two are alike."),
    ):
        bench.state.materials.set(replace(_shown(bench), of_classes=notes))
        assert panel.text.text() == told
        assert reason in panel.text.toolTip() or reason not in notes
    panel.resize(430, panel.minimumSizeHint().height())
    assert panel.text.height() >= 2 * panel.text.fontMetrics().lineSpacing()
    assert panel.table.y() >= panel.text.geometry().bottom()
    # Nothing moved when the legend came.
    assert panel.minimumSizeHint() == room


def test_the_legend_is_seen_whole_at_150_percent(qtbot: QtBot, bench: Bench) -> None:
    for column in range(2, 26, 4):
        bench.control.marks.pin((column, 5))
    panel = MaterialsPanel(bench.state, bench.control.answers)
    qtbot.addWidget(panel)
    bench.control.answers.from_marks(ANGLE)
    # What the page has for it on a screen of 1920 x 1080 px: more is taken from the plot above.
    panel.resize(436, 100)
    panel.show()
    table = panel.table
    last = table.visualRect(table.model().index(ROWS - 1, 0))
    assert table.rowCount() == 9
    assert last.bottom() <= table.viewport().height()
    assert panel.minimumSizeHint().width() <= 300
    # On a screen of 614 px half of the page is left for the plot.
    assert panel.minimumSizeHint().height() <= 360


def test_every_number_of_the_panel_is_named_to_its_left(qtbot: QtBot, bench: Bench) -> None:
    panel = MaterialsPanel(bench.state, bench.control.answers)
    qtbot.addWidget(panel)
    panel.resize(panel.minimumSizeHint())
    panel.show()
    for box in panel.findChildren(NumberBox):
        middle = box.geometry().center().y()
        named = [
            each.text()
            for each in panel.findChildren(QLabel)
            if each.geometry().right() < box.x() and each.y() <= middle <= each.geometry().bottom()
        ]
        assert box.accessibleName() in named


@pytest.mark.parametrize("classes", [1, 24, 250])
def test_every_class_has_a_colour_and_what_is_not_judged_none(classes: int) -> None:
    made = ClassMap(("a",) * classes, tuple(range(classes)), np.zeros((1, 1), np.uint8))
    table = materials_table(made, "light")
    assert table[0, 3] == 0
    assert (table[1 : classes + 3, 3] > 0).all()
    assert len(np.unique(table[1 : classes + 1], axis=0)) == classes


def test_a_class_has_the_colour_of_its_mark_wherever_it_is_shown(
    window: Window, qtbot: QtBot, tmp_path: Path
) -> None:
    state, control = window.state, window.control
    for pixel in ((3, 5), (6, 5), (30, 5)):
        control.marks.pin(pixel)
    control.marks.remove(window.marks[1].key)
    control.answers.from_marks(ANGLE)
    names = {"pin 1": 0, "pin 3": 2}
    assert {mark.name: mark.colour for mark in window.marks} == names
    materials = state.materials.value
    assert materials is not None
    assert dict(zip(materials.found.shown.names, materials.found.shown.colours, strict=True)) == names
    image, panel = window.page.image.content, window.page.materials.content
    for theme in (DARK, LIGHT):
        window.page.apply_theme(theme)
        lookup = image.materials.lut
        for row, (name, index) in enumerate(names.items()):
            wanted = [*bytes.fromhex(theme.pin(index)[1:])]
            assert lookup[row + 1, :3].tolist() == wanted
            cell = panel.table.item(row, 0)
            assert cell is not None
            assert cell.text() == name
            assert cell.icon().pixmap(14, 14).toImage().pixelColor(7, 7).name() == theme.pin(index)
            assert theme.pin(index) in [spot.brush().color().name() for spot in image.pins.points()]
    control.answers.write(opened(state), materials, tmp_path / "map.csv")
    control.answers.write(opened(state), materials, tmp_path / "map.hdr")
    lines = (tmp_path / "map.csv").read_text().splitlines()
    for name, index in names.items():
        assert any(row[:2] == [name, LIGHT.pin(index)] for row in csv.reader(lines))
        levels = ", ".join(str(level) for level in bytes.fromhex(LIGHT.pin(index)[1:]))
        assert levels.replace(" ", "") in (tmp_path / "map.hdr").read_text().replace(" ", "")


def test_classes_of_a_library_have_the_colours_of_references_of_their_names_or_new_ones(
    bench: Bench, tmp_path: Path
) -> None:
    bench.control.marks.pin((30, 5))
    library = _library(tmp_path)
    bench.control.answers.from_library(library, ANGLE)
    (name,) = _shown(bench).found.shown.names
    assert _shown(bench).found.shown.colours == (1,), "the colour of the pin is another class"
    bench.control.marks.rename(bench.state.marks.value[0].key, name)
    bench.control.answers.from_library(library, ANGLE)
    assert _shown(bench).found.shown.colours == (0,)
