"""The row of tools below the 3D view, and what it does to the panel."""

from __future__ import annotations

from dsl_app.results.cloud.look import Look
from dsl_app.results.cloud.measuring import Measure
from dsl_app.results.cloud.tools import CloudTools
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from tests.app.results.cloud.test_views import cloud_view, place_of
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench


def test_what_is_chosen_is_told(qtbot: QtBot) -> None:
    tools, told = CloudTools(), list[Look]()
    qtbot.addWidget(tools)
    tools.look_chosen.connect(told.append)
    tools.switch["box"].trigger()
    tools.kind.setCurrentIndex(1)
    tools.kind.activated.emit(1)
    tools.point_size.setValue(8)
    assert told[-1] == Look(surface=False, size=2.0, box=True)
    assert not tools.switch["light"].isEnabled()


def test_two_clicks_measure_and_nothing_is_pinned(bench: Bench, qtbot: QtBot) -> None:
    view, panel = cloud_view(bench, qtbot), bench.page.cloud
    panel.tools.measure_chosen.emit(Measure.SECTION)
    assert "Click two points" in panel._hint.text()
    for pixel in ((6, 12), (30, 12)):
        QTest.mouseClick(view, Qt.MouseButton.LeftButton, pos=place_of(bench, view, pixel))
    assert "Distance" in panel._hint.text()
    assert panel.section is not None
    assert not panel.section.isHidden()
    panel.tools.measure_chosen.emit(Measure.PLANE)
    assert panel.section.isHidden()
    middle = view.rect().center()
    panel._lasso = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=middle + QPoint(9, 9))
    assert "flat to" in panel._hint.text()
    assert bench.marks == ()


def test_the_middle_depths_are_shown_and_all_again(bench: Bench, qtbot: QtBot) -> None:
    cloud_view(bench, qtbot)
    bench.page.cloud.tools.share_chosen.emit(90)
    limits = bench.state.depth_limits.value
    assert limits is not None
    assert 700 < limits[0] < 702
    assert 715 < limits[1] < 717.5
    bench.page.cloud.tools.share_chosen.emit(100)
    assert bench.state.depth_limits.value is None
