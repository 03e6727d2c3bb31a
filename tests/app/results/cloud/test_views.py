"""The 3D view: drawing, rotating and the size of its pictures."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from dsl_app.results.cloud import points as cloud_points
from dsl_app.results.cloud.overlay import OverlayPainter
from dsl_app.results.cloud.render_window import graphics_work
from dsl_app.results.cloud.renderer import SETTLE_S
from dsl_app.results.cloud.views import DRAWING, InteractiveCloud, static_picture
from dsl_app.results.state import ResultView
from dsl_app.shared.spectrum import Pixel
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QImage, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from dsl_core.evaluation.marks import on_screen
from tests.app.support.results_bench import Bench, move
from tests.app.support.results_bench import bench as bench


def cloud_view(bench: Bench, qtbot: QtBot) -> InteractiveCloud:
    """The 3D view with its points."""
    if not graphics_work():
        pytest.skip("nothing draws in 3D here")
    bench.control.show(ResultView.CLOUD)
    qtbot.waitUntil(lambda: bench.page.cloud.view is not None)
    view = bench.page.cloud.view
    assert isinstance(view, InteractiveCloud)
    qtbot.waitUntil(lambda: view.renderer.shown > 0 and view.renderer.is_at_rest)
    return view


def place_of(bench: Bench, view: InteractiveCloud, pixel: Pixel) -> QPoint:
    """Where the point of a pixel lies in the 3D view."""
    result = bench.state.result.value
    assert result is not None
    x, y = on_screen(result.at("points_mm", pixel)[None], view.projection())[0][:2]
    return QPoint(round((1 + x) / 2 * view.width()), round((1 - y) / 2 * view.height()))


def _looks_alike(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Whether two views put all points to the same place; how deep they look does not matter."""
    return bool(np.allclose(a[[0, 1, 3]], b[[0, 1, 3]], rtol=1e-6, atol=1e-9))


def _picture(view: InteractiveCloud) -> NDArray[np.uint8]:
    """What the 3D view shows, RGB."""
    seen = view.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(seen.constBits(), np.uint8).reshape(seen.height(), seen.bytesPerLine())
    return rows[:, : 3 * seen.width()].reshape(seen.height(), seen.width(), 3).copy()


def test_a_static_picture_shows_near_points_before_far_ones() -> None:
    points = np.array([[0, 0, 900], [0, 0, 700], [50, 40, 800], [-50, -40, 800]], np.float32)
    colours = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]], np.uint8)
    picture = static_picture(points, colours, "#102030")
    assert picture is not None
    assert picture.shape == (480, 640, 3)
    assert (picture == (0, 255, 0)).all(2).any()
    assert static_picture(points[:0], colours[:0], "#000000") is None


def test_a_marked_point_is_drawn_where_the_mouse_finds_it(bench: Bench, qtbot: QtBot) -> None:
    view = cloud_view(bench, qtbot)
    result = bench.state.result.value
    assert result is not None
    view.show_marker(result.at("points_mm", (20, 8)), "#ff00ff")
    qtbot.waitUntil(lambda: view.renderer.is_at_rest)
    spots = np.argwhere((_picture(view) == (255, 0, 255)).all(2))
    place = place_of(bench, view, (20, 8))
    assert spots.mean(0) == pytest.approx((place.y(), place.x()), abs=2)


@pytest.mark.slow
@pytest.mark.parametrize("way", ["mouse", "arrow key", "wheel", "plus key"])
def test_the_view_is_turned_and_looks_as_the_camera_again(bench: Bench, qtbot: QtBot, way: str) -> None:
    view = cloud_view(bench, qtbot)
    first, middle = view.projection(), view.rect().center()
    if way == "mouse":
        QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=middle)
        move(view, middle + QPoint(40, 9), Qt.MouseButton.LeftButton)
        QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=middle + QPoint(40, 9))
    elif way == "wheel":
        at = QPointF(middle)
        turned = QWheelEvent(at, at, QPoint(), QPoint(0, 120), Qt.MouseButton.NoButton,
                             Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False)  # fmt: skip
        QApplication.sendEvent(view, turned)
    else:
        QTest.keyClick(view, Qt.Key.Key_Right if way == "arrow key" else Qt.Key.Key_Plus)
    qtbot.waitUntil(lambda: view.renderer.is_at_rest and not _looks_alike(view.projection(), first))
    QTest.keyClick(view, Qt.Key.Key_Home)
    qtbot.waitUntil(lambda: view.renderer.is_at_rest and _looks_alike(view.projection(), first))


def test_no_scale_is_told_before_there_is_a_picture_of_the_cloud(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    view, painted = cloud_view(bench, qtbot), list[object]()
    monkeypatch.setattr(OverlayPainter, "paint", lambda _, seen, __: painted.append(seen))
    view.waiting = DRAWING
    view.grab()
    assert painted == []
    view.waiting = ""
    view.grab()
    assert painted == [view._seen]
    painted.clear()
    view.show_cloud(np.empty((0, 3), np.float32), np.empty((0, 3), np.uint8))
    view.grab()
    assert painted == [], "without points there is a sentence instead of a scale"


def test_pictures_follow_the_size_of_the_window(bench: Bench, qtbot: QtBot) -> None:
    view = cloud_view(bench, qtbot)
    # A sliver: who has not turned the view sees all of the cloud in it.
    view.setFixedWidth(90)
    qtbot.waitUntil(lambda: view.renderer.is_at_rest and view.image.width() == 90)
    assert view.image.height() == view.height()
    for pixel in ((0, 0), (35, 23)):
        assert view.rect().contains(place_of(bench, view, pixel))


def test_pictures_are_as_fine_as_the_screen(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = cloud_view(bench, qtbot)
    monkeypatch.setattr(view, "devicePixelRatioF", lambda: 1.5)
    QApplication.sendEvent(view, QEvent(QEvent.Type.DevicePixelRatioChange))
    width = round(1.5 * view.width())
    qtbot.waitUntil(lambda: view.renderer.is_at_rest and view.image.width() == width)
    assert view.image.devicePixelRatio() == 1.5


@pytest.mark.slow
def test_a_large_cloud_grows_to_its_last_point(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    # However slow the machine.
    monkeypatch.setattr(cloud_points, "SLOW_S", 100.0)
    view = cloud_view(bench, qtbot)
    points = np.random.default_rng(0).normal((0, 0, 700), 20, (cloud_points.COARSE + 9, 3)).astype(np.float32)
    view.show_cloud(points, np.zeros((len(points), 3), np.uint8))
    qtbot.waitUntil(lambda: view.renderer.is_at_rest and view.renderer.shown == len(points))


def test_who_turns_the_cloud_is_not_slowed_down_by_what_moves(bench: Bench, qtbot: QtBot) -> None:
    view = cloud_view(bench, qtbot)
    middle, point = view.rect().center(), np.array([0, 0, 700], np.float32)
    view.show_marker(point, "#ff0000")
    QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=middle)
    view.show_marker(point + 1, "#ff0000")
    # Unlike QTest.qWait, this lets other threads run.
    qtbot.wait(int(2000 * SETTLE_S))
    assert view.renderer._window.cloud.is_coarse
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=middle)
    qtbot.waitUntil(lambda: not view.renderer._window.cloud.is_coarse)


def test_the_thread_that_draws_ends_with_the_window(bench: Bench, qtbot: QtBot) -> None:
    view = cloud_view(bench, qtbot)
    assert any(thread.name == "3d-view" for thread in threading.enumerate())
    view.renderer._request(lambda: time.sleep(0.3))
    bench.window.close()
    assert not any(thread.name == "3d-view" for thread in threading.enumerate())
    view.show_marker(None, "#ff0000")
