"""The picture of a result by mouse and keys, and what each view paints."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.layers import NO_COLOUR, Layers, rgb_of
from dsl_app.results.state import QualityMap, ResultView, Tool
from dsl_app.shared.theme import DARK as DARK_THEME
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench
from tests.app.support.small_result import DARK, write_small_result


def test_a_click_pins_and_keys_move_pin_and_remove(bench: Bench, qtbot: QtBot) -> None:
    QTest.mouseClick(bench.view, Qt.MouseButton.LeftButton, pos=bench.at((10, 10)))
    qtbot.waitUntil(lambda: len(bench.marks) == 1)
    assert bench.marks[0].pixel == (10, 10)
    canvas = bench.page.image.content.canvas
    canvas.setFocus()
    QTest.keyClick(canvas, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)
    QTest.keyClick(canvas, Qt.Key.Key_Up)
    QTest.keyClick(canvas, Qt.Key.Key_Return)
    assert bench.marks[1].pixel == (20, 9)
    qtbot.waitUntil(lambda: "mm" in bench.page.marks.figures.toPlainText())
    QTest.keyClick(canvas, Qt.Key.Key_Delete)
    assert [mark.pixel for mark in bench.marks] == [(10, 10)]
    bench.window.do("undo")
    assert len(bench.marks) == 2


def test_regions_are_drawn_with_every_tool(bench: Bench, qtbot: QtBot) -> None:
    bench.page.bar.tools[Tool.RECTANGLE].click()
    bench.drag([(2, 6), (4, 8), (7, 10)])
    assert bench.marks[0].used == 30
    bench.page.bar.tools[Tool.LASSO].click()
    bench.drag([(20, 5), (30, 5), (30, 15), (20, 15)])
    assert bench.marks[1].used == pytest.approx(100, abs=25)
    bench.page.bar.tools[Tool.POLYGON].click()
    for corner in ((2, 12), (12, 12), (12, 20)):
        QTest.mouseClick(bench.view, Qt.MouseButton.LeftButton, pos=bench.at(corner))
        QTest.qWait(1)
    begun = bench.page.image.content.box.is_drawing
    QTest.keyClick(bench.page.image.content.canvas, Qt.Key.Key_Escape)
    assert (begun, bench.page.image.content.box.is_drawing) == (True, False)
    for corner in ((2, 12), (12, 12), (12, 20)):
        QTest.mouseClick(bench.view, Qt.MouseButton.LeftButton, pos=bench.at(corner))
        QTest.qWait(1)
    QTest.keyClick(bench.page.image.content.canvas, Qt.Key.Key_Return)
    assert bench.marks[2].used == pytest.approx(40, abs=12)


def test_an_outline_that_is_begun_does_not_go_on_in_another_result(bench: Bench, tmp_path: Path) -> None:
    bench.page.bar.tools[Tool.POLYGON].click()
    for corner in ((2, 12), (12, 12), (12, 20)):
        QTest.mouseClick(bench.view, Qt.MouseButton.LeftButton, pos=bench.at(corner))
        QTest.qWait(1)
    assert bench.page.image.content.box.is_drawing
    (tmp_path / "other").mkdir()
    bench.window.open_path(write_small_result(tmp_path / "other"))
    QTest.keyClick(bench.page.image.content.canvas, Qt.Key.Key_Return)
    assert not any(mark.kind == "region" for mark in bench.marks)


def test_an_ellipse_holds_pi_quarters_of_its_box(bench: Bench) -> None:
    bench.page.bar.tools[Tool.ELLIPSE].click()
    bench.drag([(19, 3), (25, 9), (33, 17)])
    (region,) = bench.marks
    # A box of 15 x 15 pixels.
    assert region.used == pytest.approx(np.pi / 4 * 225, rel=0.03)
    outline = np.array(region.outline_px)
    np.testing.assert_allclose([outline.min(0), outline.max(0)], [(18.5, 2.5), (33.5, 17.5)], atol=0.02)


def test_every_view_paints_the_shape_of_the_result(bench: Bench) -> None:
    result = bench.state.result.value
    assert result is not None
    image, seen = bench.page.image.content, 0
    for view, quality in itertools.product(ResultView, QualityMap):
        bench.state.quality.set(quality)
        bench.state.view.set(view)
        layer = Layers(result).layer(bench.state)
        assert layer is not None
        assert rgb_of(layer).shape == (24, 36, 3)
        assert image.legend.isVisible() == bool(layer.keys)
        # What is hatched in the picture is so in the legend, and what is faint has an outline.
        faint = sum(colour.startswith("rgba") for colour, *_ in layer.keys)
        hatched = sum(colour == NO_COLOUR for colour, *_ in layer.keys)
        if layer.keys:
            text = image.legend.text()
            assert (text.count("▨"), text.count("□")) == (hatched, faint - hatched)
            assert not hatched or image.no_values.isVisible()
        seen += faint
        assert image.image.image.shape[:2] == (24, 36)
    assert seen


def test_depth_outside_the_limits_is_transparent_and_the_bar_says_them(bench: Bench, qtbot: QtBot) -> None:
    bar, image = bench.page.bar, bench.page.image.content
    bench.control.show(ResultView.COLOUR)
    assert not bar.near.isVisible()
    bench.control.show(ResultView.DEPTH)
    assert (bar.automatic.isChecked(), bar.near.isVisible()) == (True, True)
    automatic = image.bar.levels()
    np.testing.assert_allclose((bar.near.value(), bar.far.value()), automatic, atol=0.06)
    bar.near.setValue(705.0)
    bar.far.setValue(710.0)
    assert bench.state.depth_limits.value == (705.0, 710.0)
    assert not bar.automatic.isChecked()
    assert image.bar.levels() == (705.0, 710.0)
    # Columns 10 to 20 have depths from 705 to 710 mm.
    assert np.isfinite(image.image.image).sum(1).tolist() == [11] * 24
    image.image.render()
    painted = image.image.qimage
    alphas = [painted.pixelColor(x, 8).alpha() for x in (9, 10, 20, 21)]
    assert alphas == [0, 255, 255, 0]
    bar.far.setValue(700.0)
    assert bar.far.value() == 710.0
    bar.automatic.click()
    assert bar.automatic.isChecked()
    assert image.bar.levels() == automatic
    bench.window.do("undo")
    assert (bar.near.value(), bar.automatic.isChecked()) == (705.0, False)


def test_a_class_map_lies_over_colours_and_hides_no_other_view(bench: Bench) -> None:
    layer = bench.page.image.content.materials
    bench.control.marks.pin((30, 5))
    bench.control.answers.from_marks(bench.page.materials.content.way)
    assert layer.isVisible()
    for view in (ResultView.BAND, ResultView.DEPTH, ResultView.QUALITY):
        bench.control.show(view)
        assert not layer.isVisible()
    bench.control.show(ResultView.COLOUR)
    assert layer.isVisible()


def test_what_has_no_value_is_hatched_and_no_dark_surface(bench: Bench) -> None:
    canvas, image = bench.page.image.content.canvas, bench.page.image.content
    bench.control.show(ResultView.DEPTH)
    bench.page.apply_theme(DARK_THEME)
    surround = canvas.grab().toImage().pixelColor(1, 1).name()
    assert surround == DARK_THEME.surround
    at = bench.at(DARK)
    seen = {canvas.grab().toImage().pixelColor(at + QPoint(dx, 0)).name() for dx in range(-3, 4)}
    assert seen == {DARK_THEME.line, DARK_THEME.muted}
    # Where there is nothing to tell, quality has a colour of its own.
    bench.control.show(ResultView.QUALITY)
    assert not image.no_values.isVisible()
