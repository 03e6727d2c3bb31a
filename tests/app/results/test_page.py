"""The Results page: what it shows without a result, its keys and themes."""

from __future__ import annotations

from pathlib import Path

from dsl_app.results.export.dialog import ExportDialog
from dsl_app.results.state import ResultView
from dsl_app.shared.theme import DARK as DARK_THEME
from dsl_app.shared.theme import LIGHT
from dsl_app.shared.widgets.deferred import Deferred
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QTabWidget
from pytestqt.qtbot import QtBot

from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench
from tests.app.support.small_result import write_small_result


def test_without_a_result_a_sentence_says_what_to_do(qtbot: QtBot, tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    qtbot.addWidget(bench.window)
    bench.window.show()
    assert "Open a result" in " ".join(label.text() for label in bench.page.welcome.findChildren(QLabel))
    assert bench.page.welcome.isVisible()
    assert not bench.page.welcome.files.isVisible()
    bench.page.welcome.demo.click()
    assert bench.asked == ["demo"]
    bench.state.offer.set(tmp_path / "scan.dsl")
    assert "scan.dsl has no result yet" in bench.page.offer.message.text()
    assert bench.page.offer.reconstruct.isVisible()


def test_keys_do_nothing_with_a_result_that_an_offered_scan_hides(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((3, 5))
    bench.control.point_at((3, 5))
    QApplication.clipboard().setText("mine")
    bench.state.offer.set(tmp_path / "scan.dsl")
    for key in ("export", "intensity_graph", "copy_spectra", "export_spectra"):
        bench.window.do(key)
        said = bench.window.toasts.shown[-1].text
        assert "Choose 'Not now' to return to the result" in said
        bench.window.toasts.withdraw(said)
    assert not bench.page.findChildren(ExportDialog)
    assert QApplication.clipboard().text() == "mine"
    QTest.mouseClick(bench.page.offer.later, Qt.MouseButton.LeftButton)
    assert bench.page.image.isVisible()
    bench.window.do("copy_spectra")
    assert QApplication.clipboard().text() != "mine"


def test_recent_files_are_offered_and_vanished_ones_marked(qtbot: QtBot, tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    qtbot.addWidget(bench.window)
    bench.window.show()
    for path in (tmp_path / "gone.zarr", write_small_result(tmp_path)):
        bench.window.parts.recent.add(path)
    files = bench.page.welcome.files
    assert "(missing)" in files.item(1).text()
    files.setFocus()
    files.setCurrentRow(1)
    QTest.keyClick(files, Qt.Key.Key_Return)
    assert "gone.zarr no longer exists" in bench.window.toasts.shown[-1].text
    assert files.count() == 1
    files.setCurrentRow(0)
    QTest.keyClick(files, Qt.Key.Key_Return)
    assert bench.state.result.value is not None
    assert not bench.page.welcome.isVisible()


def test_the_keys_1_to_5_choose_the_view(bench: Bench, qtbot: QtBot) -> None:
    bench.page.image.content.canvas.setFocus()
    keys = (Qt.Key.Key_1, Qt.Key.Key_2, Qt.Key.Key_3, Qt.Key.Key_4, Qt.Key.Key_5)
    for key, view in zip(keys, ResultView, strict=True):
        QTest.keyClick(bench.window, key)
        qtbot.waitUntil(lambda view=view: bench.state.view.value is view)  # type: ignore[misc]
        assert bench.page.bar.views[view].isChecked()
    assert bench.page.cloud.isVisible()
    QTest.keyClick(bench.window, Qt.Key.Key_Period)
    qtbot.waitUntil(lambda: bench.state.band.value == 24)


def test_themes_reach_every_panel(bench: Bench) -> None:
    bench.control.marks.pin((10, 10))
    for theme in (LIGHT, DARK_THEME):
        bench.page.apply_theme(theme)
        assert bench.page.image.content.canvas.backgroundBrush().color().name() == theme.surround


def test_the_plot_keeps_its_height_beside_every_tab_of_the_smallest_window(
    bench: Bench, qtbot: QtBot
) -> None:
    bench.window.resize(1280, 800)
    page = bench.page
    tabs = page.findChild(QTabWidget)
    assert tabs is not None
    heights = []
    for place in range(tabs.count()):
        tabs.setCurrentIndex(place)
        room = tabs.currentWidget()
        qtbot.waitUntil(lambda room=room: not isinstance(room, Deferred) or room.made is not None)  # type: ignore[misc]
        qtbot.wait(20)
        heights.append(page.spectra.height())
    assert min(heights) == max(heights) > 250
