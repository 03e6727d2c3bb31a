"""The 3D cloud follows the state: limits, cursor, pins and lasso."""

from __future__ import annotations

import gc
import threading
import weakref
from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.cloud import panel as cloud_panel
from dsl_app.results.cloud.measuring import Measure
from dsl_app.results.cloud.render_window import RenderWindow, graphics_work
from dsl_app.results.cloud.views import DRAWING, InteractiveCloud, StaticCloud
from dsl_app.results.layers import NOTHING
from dsl_app.results.state import QualityMap, ResultView, Tool
from dsl_app.shared.theme import DARK, LIGHT
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from dsl_core.errors import Cancelled
from dsl_core.io.result.result_file import load_result, save_result
from tests.app.results.cloud.test_views import _picture, cloud_view, place_of
from tests.app.support.results_bench import Bench, move
from tests.app.support.results_bench import bench as bench
from tests.app.support.small_result import write_small_result


def _still_view(bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> StaticCloud:
    """The view where nothing draws in 3D, with its points."""
    monkeypatch.setattr(cloud_panel, "prepare_cloud_view", lambda: False)
    bench.control.show(ResultView.CLOUD)
    qtbot.waitUntil(lambda: bench.page.cloud.view is not None)
    view = bench.page.cloud.view
    assert isinstance(view, StaticCloud)
    qtbot.waitUntil(lambda: not view._picture.pixmap().isNull())
    return view


def _open_farther(bench: Bench, folder: Path, *without: str) -> None:
    """Open a result that is twice as far away, without some arrays."""
    assert bench.state.result.value is not None
    data = load_result(bench.state.result.value.path).load()
    for name in ("depth_mm", "points_mm"):
        data[name] *= 2
    bench.window.open_path(save_result(data.drop_vars(list(without)), folder / "farther.zarr"))


def test_without_graphics_the_cloud_is_a_picture_with_a_sentence(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = _still_view(bench, qtbot, monkeypatch)
    labels = view.findChildren(QLabel)
    assert any("cannot be rotated here" in label.text() for label in labels)


def test_a_result_without_the_colours_that_are_chosen_is_grey(
    bench: Bench, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = _still_view(bench, qtbot, monkeypatch)
    bench.state.cloud_by.set(ResultView.QUALITY)
    bench.state.quality.set(QualityMap.DEPTH_SPREAD)
    _open_farther(bench, tmp_path, "depth_std_mm")
    qtbot.waitUntil(lambda: view._drawn is not None and bool(view._drawn[0][:, 2].min() >= 1400))
    assert view._drawn is not None
    assert {tuple(colour) for colour in view._drawn[1].tolist()} == {tuple(bytes.fromhex(NOTHING[1:]))}
    assert bench.page.image.content.legend.text() == "This result has no deviation of depth."


def test_a_result_without_points_leaves_nothing_of_the_one_before(
    bench: Bench, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = _still_view(bench, qtbot, monkeypatch)
    _open_farther(bench, tmp_path, "points_mm")
    # Its pixels have a depth.
    qtbot.waitUntil(lambda: view._picture.text().startswith("No point is shown: the result has none"))
    view.resize(view.size() * 0.9)
    assert view._picture.pixmap().isNull()


def test_a_measurement_does_not_go_on_in_another_result(
    bench: Bench, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _still_view(bench, qtbot, monkeypatch)
    panel = bench.page.cloud
    panel.tools.measure_chosen.emit(Measure.DISTANCE)
    panel._measure_pixel((30, 20))
    panel._lasso, panel._press = [(0.0, 0.0)], (0.0, 0.0)
    _open_farther(bench, tmp_path)
    assert [panel._lasso, panel._press] == [[], None]
    panel._measure_pixel((3, 3))
    assert panel._hint.text() == Measure.DISTANCE.value
    panel._measure_pixel((30, 20))
    assert panel._hint.text().startswith("Distance ")


def test_lasso_and_measure_have_the_button_one_at_a_time(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    _still_view(bench, qtbot, monkeypatch)
    panel, tool = bench.page.cloud, bench.state.tool
    panel.tools.measure.choose(Measure.SECTION)
    panel.tools.measure_chosen.emit(Measure.SECTION)
    panel._measure_pixel((3, 3))
    panel._measure_pixel((30, 20))
    tool.set(Tool.LASSO)
    assert bool(panel._draws)
    assert panel._hint.text() == "Draw around points with the left button."
    assert panel.tools.measure.currentData() is Measure.NOTHING
    assert panel.section is not None
    assert panel.section.isHidden()
    panel.tools.measure_chosen.emit(Measure.DISTANCE)
    assert tool.value is Tool.PIN
    assert not bool(panel._draws)
    assert panel._hint.text() == Measure.DISTANCE.value


def test_a_measured_answer_is_still_there_after_a_visit_to_another_page(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = _still_view(bench, qtbot, monkeypatch)
    panel = bench.page.cloud
    panel.tools.measure_chosen.emit(Measure.DISTANCE)
    panel._measure_pixel((3, 3))
    panel._measure_pixel((30, 20))
    answer = panel._hint.text()
    assert answer.startswith("Distance ")
    bench.page.hide()
    bench.page.show()
    qtbot.waitUntil(view.isVisible)
    assert panel._hint.text() == answer
    bench.state.tool.set(Tool.RECTANGLE)
    assert panel._hint.text() == answer
    panel._measure_pixel((3, 3))
    assert panel._hint.text() == Measure.DISTANCE.value


def test_it_says_what_it_does_until_there_is_a_picture(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not graphics_work():
        pytest.skip("nothing draws in 3D here")
    go, real = threading.Event(), RenderWindow

    def slow() -> RenderWindow:
        go.wait(5)
        return real()

    monkeypatch.setattr("dsl_app.results.cloud.renderer.RenderWindow", slow)
    panel = bench.page.cloud
    bench.control.show(ResultView.CLOUD)
    assert panel.message.text() == "Preparing the 3D view…"
    qtbot.waitUntil(lambda: panel.view is not None)
    view = panel.view
    assert isinstance(view, InteractiveCloud)
    qtbot.waitUntil(lambda: view.isVisible() and not view.grab().isNull())
    assert view.waiting == DRAWING
    picture = _picture(view)
    assert (picture != picture[0, 0]).any(), "it says nothing"
    view.say_more()
    assert "graphics card" in view.waiting
    go.set()
    qtbot.waitUntil(lambda: not view.waiting, timeout=30_000)


def test_3d_that_fails_leaves_a_picture_and_says_what_to_do(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken() -> RenderWindow:
        raise RuntimeError("no context for <OpenGL>.")

    monkeypatch.setattr("dsl_app.results.cloud.renderer.RenderWindow", broken)
    monkeypatch.setattr(cloud_panel, "prepare_cloud_view", lambda: True)
    panel = bench.page.cloud
    bench.control.show(ResultView.CLOUD)
    qtbot.waitUntil(lambda: isinstance(panel.view, StaticCloud))
    assert panel.view is not None
    labels = panel.view.findChildren(QLabel)
    qtbot.waitUntil(lambda: any(not label.pixmap().isNull() for label in labels))
    said = next(label.text() for label in labels if label.text())
    assert "no context for <OpenGL>)" in said
    assert "Update the graphics driver" in said
    assert not panel.tools.isEnabled()
    assert "rotate" not in panel._hint.text()
    # It takes no more than its half from the picture next to it.
    assert panel.view.minimumSizeHint().width() < 300
    # The picture goes over into its surroundings in either theme.
    panel.view.resize(300, 600)
    for theme in (LIGHT, DARK):
        panel.view.apply_theme(theme)
        drawn = next(label for label in labels if not label.pixmap().isNull())
        seen = drawn.grab().toImage()
        edge = [seen.pixelColor(seen.width() // 2, y).name() for y in (0, seen.height() - 1)]
        within = drawn.pixmap().toImage().pixelColor(0, 0).name()
        assert {*edge, within} == {theme.raised}


def test_the_cloud_hides_what_lies_outside_the_limits_and_keeps_its_view(bench: Bench, qtbot: QtBot) -> None:
    view = cloud_view(bench, qtbot)
    assert view.renderer.shown == 24 * 36 - 1
    view.renderer.call(lambda window: window.turn(3, 0), moves=True)
    qtbot.waitUntil(lambda: view.renderer.is_at_rest)
    before = view.projection()[:, 0].copy()
    bench.control.limit_depth((705.0, 710.0))
    qtbot.waitUntil(lambda: view.renderer.shown == 24 * 11)
    qtbot.waitUntil(lambda: view.renderer.is_at_rest)
    np.testing.assert_allclose(view.projection()[:2, 0], before[:2])
    bench.state.depth_limits.set((1.0, 2.0))
    qtbot.waitUntil(lambda: view.renderer.shown == 0)
    bench.control.limit_depth(None)
    qtbot.waitUntil(lambda: view.renderer.shown == 24 * 36 - 1)


def test_tools_stay_where_they_are_while_the_hint_below_them_changes(bench: Bench, qtbot: QtBot) -> None:
    cloud_view(bench, qtbot)
    panel = bench.page.cloud
    tops = set()
    for words in ("Short.", "Long enough for two lines. " * 3):
        panel._hint.setText(words)
        QTest.qWait(5)
        tops.add(panel.tools.y())
    assert len(tops) == 1


def test_the_cloud_and_the_picture_share_one_cursor(bench: Bench, qtbot: QtBot) -> None:
    view = cloud_view(bench, qtbot)
    widget = view
    middle = QPoint(widget.width() // 2, widget.height() // 2)
    spot = place_of(bench, view, (20, 8))
    move(widget, spot)
    qtbot.waitUntil(lambda: bench.state.cursor.value == (20, 8))
    QTest.mouseClick(widget, Qt.MouseButton.LeftButton, pos=spot)
    qtbot.waitUntil(lambda: len(bench.marks) == 1)
    bench.state.tool.set(Tool.LASSO)
    QTest.mousePress(widget, Qt.MouseButton.LeftButton, pos=middle - QPoint(60, 60))
    for corner in (QPoint(60, -60), QPoint(60, 60), QPoint(-60, 60)):
        move(widget, middle + corner, Qt.MouseButton.LeftButton)
    QTest.mouseRelease(widget, Qt.MouseButton.LeftButton, pos=middle + QPoint(-60, 60))
    qtbot.waitUntil(lambda: len(bench.marks) == 2)
    assert bench.marks[1].runs


def test_a_3d_view_that_was_cancelled_comes_when_it_is_wanted_again(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(tmp_path)
    qtbot.addWidget(bench.window)
    bench.window.show()
    bench.window.open_path(write_small_result(tmp_path))
    tries: list[None] = []

    def prepare() -> bool:
        tries.append(None)
        if len(tries) == 1:
            raise Cancelled
        if len(tries) == 2:
            raise ImportError("no vtk")
        return False

    monkeypatch.setattr(cloud_panel, "prepare_cloud_view", prepare)
    panel = bench.page.cloud
    for words in ("was cancelled", "could not be prepared: no vtk"):
        bench.control.show(ResultView.CLOUD)
        qtbot.waitUntil(lambda words=words: words in panel.message.text())  # type: ignore[misc]
        bench.control.show(ResultView.COLOUR)
    bench.control.show(ResultView.CLOUD)
    qtbot.waitUntil(lambda: panel.view is not None)
    bench.window.close()


@pytest.mark.slow
def test_a_result_that_is_closed_leaves_no_copy_behind(bench: Bench, qtbot: QtBot) -> None:
    bench.control.show(ResultView.CLOUD)
    qtbot.waitUntil(lambda: bench.page.cloud.view is not None)
    QTest.qWait(50)
    bench.control.show(ResultView.COLOUR)
    result = weakref.ref(bench.state.result.value)
    assert result() is not None
    bench.state.result.set(None)
    gc.collect()
    assert result() is None
