from __future__ import annotations

import gc
import itertools
import threading
import time
import weakref
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from dsl_app.results.cloud import panel as scene_panel
from dsl_app.results.cloud import points as cloud
from dsl_app.results.cloud.render_window import graphics_work
from dsl_app.results.cloud.renderer import SETTLE_S
from dsl_app.results.cloud.scene import TurnedScene
from dsl_app.results.cloud.still_scene import still_picture
from dsl_app.results.controller import ResultsController
from dsl_app.results.export_dialog import ExportDialog
from dsl_app.results.intensity_window import ticks
from dsl_app.results.layers import Layers, rgb_of
from dsl_app.results.library_dialog import LibraryDialog
from dsl_app.results.marks.figures import figures_of
from dsl_app.results.page import ResultsPage
from dsl_app.results.state import Mark, Quality, ResultsState, Seek, Tool, View
from dsl_app.results.welcome import Welcome
from dsl_app.shared.spectrum import Pixel, Spectrum
from dsl_app.shared.theme import DARK as DARK_THEME
from dsl_app.shared.theme import LIGHT
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shared.widgets.spectrum_curve import split_by_share
from dsl_app.shell.application import make_window, open_first_page
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent, QImage, QMouseEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QLabel, QWidget
from pytestqt.qtbot import QtBot

from dsl_core.errors import Cancelled
from dsl_core.evaluation.marks import on_screen
from dsl_core.workflows.inspection import IntensityGraph
from tests.app.support.doubles import InlineRunner
from tests.app.support.small_result import BLUE, DARK, NM, RED, UNREACHED, write_reference, write_small_result
from tests.io.spectra.test_reference_file import write_library


def move(widget: QWidget, to: QPoint, buttons: Qt.MouseButton = Qt.MouseButton.NoButton) -> None:
    """Move the mouse as a person does, wherever the cursor of the screen may be."""
    event = QMouseEvent(
        QMouseEvent.Type.MouseMove,
        QPointF(to),
        QPointF(widget.mapToGlobal(to)),
        Qt.MouseButton.NoButton,
        buttons,
        Qt.KeyboardModifier.NoModifier,
    )
    QApplication.sendEvent(widget, event)
    QTest.qWait(5)


class Bench:
    """A window with the Results page alone; jobs run at once."""

    def __init__(self, folder: Path) -> None:
        self.state = ResultsState()
        self.page: ResultsPage
        self.asked: list[str] = []
        self.window = make_window({"results": self._make}, folder)
        open_first_page(self.window)

    def _make(self) -> PageWidget:
        runner, window = InlineRunner(), self.window
        self.control = ResultsController(self.state, runner, window.toasts, window.parts.undo)
        welcome = Welcome(window.parts.recent, window.open_path, lambda: self.asked.append("demo"))
        self.page = ResultsPage(self.state, self.control, runner, welcome)
        self.page.apply_theme(window.theme)
        return self.page

    @property
    def view(self) -> QWidget:
        viewport: QWidget = self.page.image.canvas.viewport()
        return viewport

    def at(self, pixel: Pixel) -> QPoint:
        """Where a pixel of the image lies on the canvas."""
        image = self.page.image
        at = image.canvas.mapFromScene(image.box.mapViewToScene(QPointF(*pixel)))
        return QPoint(at.x(), at.y())

    def drag(self, corners: list[Pixel]) -> None:
        left = Qt.MouseButton.LeftButton
        QTest.mousePress(self.view, left, pos=self.at(corners[0]))
        for corner in corners[1:]:
            move(self.view, self.at(corner), left)
        QTest.mouseRelease(self.view, left, pos=self.at(corners[-1]))

    @property
    def marks(self) -> tuple[Mark, ...]:
        return self.state.marks.value


@pytest.fixture
def bench(qtbot: QtBot, tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    qtbot.addWidget(made.window)
    made.window.resize(1280, 800)
    made.window.show()
    qtbot.waitExposed(made.window)
    made.window.open_path(write_small_result(tmp_path))
    qtbot.waitUntil(lambda: all(room.made is not None for room in made.page.findChildren(Deferred)))
    QTest.qWait(20)
    yield made
    made.window.close()


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
    assert "scan.dsl is a scan without a result" in bench.page.message.text()
    assert bench.page.reconstruct.isVisible()


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
    assert "gone.zarr does not exist any more" in bench.window.toasts.shown[-1].text
    assert files.count() == 1
    files.setCurrentRow(0)
    QTest.keyClick(files, Qt.Key.Key_Return)
    assert bench.state.result.value is not None
    assert not bench.page.welcome.isVisible()


def test_the_keys_1_to_5_choose_the_view(bench: Bench, qtbot: QtBot) -> None:
    bench.page.image.canvas.setFocus()
    keys = (Qt.Key.Key_1, Qt.Key.Key_2, Qt.Key.Key_3, Qt.Key.Key_4, Qt.Key.Key_5)
    for key, view in zip(keys, View, strict=True):
        QTest.keyClick(bench.window, key)
        qtbot.waitUntil(lambda view=view: bench.state.view.value is view)  # type: ignore[misc]
        assert bench.page.bar.views[view].isChecked()
    assert bench.page.scene.isVisible()
    QTest.keyClick(bench.window, Qt.Key.Key_Period)
    qtbot.waitUntil(lambda: bench.state.band.value == 24)


def test_without_graphics_the_cloud_is_a_picture_with_a_sentence(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene_panel, "prepare_scene", lambda: False)
    bench.control.show(View.CLOUD)
    qtbot.waitUntil(lambda: bench.page.scene.scene is not None)
    scene = bench.page.scene.scene
    assert scene is not None
    labels = scene.widget.findChildren(QLabel)
    qtbot.waitUntil(lambda: any(not label.pixmap().isNull() for label in labels))
    assert any("cannot be turned here" in label.text() for label in labels)


def test_pointing_shows_the_pixel_and_its_spectrum(bench: Bench, qtbot: QtBot) -> None:
    move(bench.view, bench.at((20, 7)))
    move(bench.view, bench.at((20, 8)))
    qtbot.waitUntil(lambda: bench.state.cursor.value == (20, 8))
    text = bench.page.readout.values.text()
    assert "pixel 20, 8" in text
    assert "z 710.00 ± 0.25 mm" in text
    assert "545 nm  0.400 ± 0.010" in text
    x, y = bench.page.spectra.live.solid.getData()
    assert x.tolist() == NM.tolist()
    np.testing.assert_allclose(y, RED, atol=1e-4)


def test_a_bad_pixel_says_why(bench: Bench) -> None:
    bench.control.point_at(DARK)
    assert "too little projector light" in bench.page.readout.reasons.text()
    assert not bench.page.spectra.live.solid.isVisible()
    bench.control.point_at(UNREACHED)
    assert "430–445 nm" in bench.page.readout.reasons.text()
    _, dashed = bench.page.spectra.live.dashed.getData()
    assert np.isfinite(dashed).sum() == 5
    bench.control.point_at((9, 9))
    assert "Nothing to remark" in bench.page.readout.reasons.text()


def test_a_click_pins_and_keys_move_pin_and_remove(bench: Bench, qtbot: QtBot) -> None:
    QTest.mouseClick(bench.view, Qt.MouseButton.LeftButton, pos=bench.at((10, 10)))
    qtbot.waitUntil(lambda: len(bench.marks) == 1)
    assert bench.marks[0].pixel == (10, 10)
    canvas = bench.page.image.canvas
    canvas.setFocus()
    QTest.keyClick(canvas, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)
    QTest.keyClick(canvas, Qt.Key.Key_Up)
    QTest.keyClick(canvas, Qt.Key.Key_Return)
    assert bench.marks[1].pixel == (20, 9)
    assert "mm" in bench.page.marks.figures.text()
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
    begun = bench.page.image.box.is_drawing
    QTest.keyClick(bench.page.image.canvas, Qt.Key.Key_Escape)
    assert (begun, bench.page.image.box.is_drawing) == (True, False)
    for corner in ((2, 12), (12, 12), (12, 20)):
        QTest.mouseClick(bench.view, Qt.MouseButton.LeftButton, pos=bench.at(corner))
        QTest.qWait(1)
    QTest.keyClick(bench.page.image.canvas, Qt.Key.Key_Return)
    assert bench.marks[2].used == pytest.approx(40, abs=12)


def test_an_ellipse_holds_pi_quarters_of_its_box(bench: Bench) -> None:
    bench.page.bar.tools[Tool.ELLIPSE].click()
    bench.drag([(19, 3), (25, 9), (33, 17)])
    (region,) = bench.marks
    # A box of 15 x 15 pixels.
    assert region.used == pytest.approx(np.pi / 4 * 225, rel=0.03)
    outline = np.array(region.outline_px)
    np.testing.assert_allclose([outline.min(0), outline.max(0)], [(18.5, 2.5), (33.5, 17.5)], atol=0.02)


def test_the_list_names_hides_and_selects(bench: Bench) -> None:
    bench.control.marks.pin((10, 10))
    bench.control.marks.pin((20, 10))
    tree = bench.page.marks.tree
    first = tree.topLevelItem(0)
    assert first is not None
    first.setText(0, "sky")
    assert bench.marks[0].name == "sky"
    again = tree.topLevelItem(0)
    assert again is not None
    again.setCheckState(0, Qt.CheckState.Unchecked)
    assert not bench.marks[0].shown
    assert bench.marks[0].key not in bench.page.spectra._curves
    now = tree.topLevelItem(0)
    assert now is not None
    tree.setCurrentItem(now)
    assert bench.state.selected.value == bench.marks[0].key


def test_a_mark_that_lost_its_spectrum_says_why_and_is_drawn_nowhere(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = Spectrum(np.empty(0), np.empty(0))
    bench.control.marks.pin((10, 10))
    bench.state.marks.set(
        (
            *bench.marks,
            Mark("pin", "far", 1, nothing, pixel=(990, 5), trouble="Pixel 990, 5 has no spectrum here."),
            Mark("region", "leaf", 2, nothing, runs=((990, 0, 5),), trouble="No pixel."),
            Mark("reference", "tile", 3, nothing, file=Path("tile.csv"), trouble="tile.csv is gone."),
        )
    )
    tree = bench.page.marks.tree
    rows = [tree.topLevelItem(row) for row in range(4)]
    assert [row.text(1) for row in rows if row is not None] == ["10, 10", *["no spectrum"] * 3]
    assert [row.toolTip(0) for row in rows[2:] if row is not None] == ["No pixel.", "tile.csv is gone."]
    assert list(bench.page.spectra._curves) == [bench.marks[0].key]
    assert len(bench.page.image.pins.data) == 1
    scene, result, drawn = bench.page.scene, bench.state.result.value, Mock()
    assert result is not None
    with monkeypatch.context() as patch:
        patch.setattr(scene, "isVisible", lambda: True)
        patch.setattr(scene, "_layers", Layers(result))
        patch.setattr(scene, "scene", drawn)
        scene._show_pins()
    assert len(drawn.show_pins.call_args.args[0]) == 1
    assert "distance" not in figures_of(select(bench, 0), DARK_THEME)
    assert "Pixel 990, 5" in figures_of(select(bench, 1), DARK_THEME)
    bench.page.marks.remove_selected()
    assert [mark.name for mark in bench.marks] == ["pin 1", "leaf", "tile"]


def select(bench: Bench, place: int) -> ResultsState:
    """Select the mark at a place."""
    bench.state.selected.set(bench.marks[place].key)
    return bench.state


def test_references_are_dropped_and_compared(bench: Bench, qtbot: QtBot, tmp_path: Path) -> None:
    bench.control.marks.pin((10, 10))
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(write_reference(tmp_path / "tile <b>.csv", 2 * BLUE)))])
    drop = QDropEvent(
        QPointF(50, 50),
        Qt.DropAction.CopyAction,
        data,
        Qt.MouseButton.LeftButton,
        Qt.KeyboardModifier.NoModifier,
    )
    bench.window.dropEvent(drop)
    qtbot.waitUntil(lambda: len(bench.marks) == 2)
    bench.state.selected.set(bench.marks[0].key)
    text = figures_of(bench.state, LIGHT)
    assert "tile &lt;b&gt;" in text
    assert "2.000" in text
    assert "ΔE00" in bench.page.marks.figures.text()


def test_a_library_that_is_dropped_asks_which_spectrum(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((10, 10))
    bench.window.open_path(write_library(tmp_path / "plants.sli"))
    (dialog,) = bench.page.findChildren(LibraryDialog)
    assert not dialog.take.isEnabled()
    assert "2 of 2 listed, 0 chosen" in dialog.text.text()
    dialog.filter.setText("BRI")
    assert [dialog.list.item(i).isHidden() for i in (0, 1)] == [True, False]
    dialog.list.selectAll()
    dialog.take.click()
    assert [mark.name for mark in bench.marks] == ["pin 1", "Brick"]
    assert not dialog.isVisible()
    bench.state.selected.set(bench.marks[0].key)
    assert "Brick" in bench.page.marks.figures.text()
    bench.window.open_path(tmp_path / "plants.hdr")
    again = bench.page.findChildren(LibraryDialog)[-1]
    again.reject()
    assert bench.state.library.value is None
    assert len(bench.marks) == 2


def test_spectra_go_to_the_clipboard_and_to_a_file(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.control.marks.pin((10, 10))
    bench.page.marks.tree.setFocus()
    QTest.keyClick(bench.page.marks.tree, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    assert QApplication.clipboard().text().startswith("wavelength_nm\tpin 1: reflectance (1)\t")
    names = iter([str(tmp_path / "a"), "", str(tmp_path / "a.csv")])
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (next(names), ""))
    for _ in range(3):
        bench.window.do("export_spectra")
    assert "Wrote 1 spectrum" in bench.window.toasts.shown[-1].text
    assert [path.name for path in tmp_path.glob("a*")] == ["a.csv"]


def test_the_search_is_shown_with_its_share(bench: Bench) -> None:
    bench.control.point_at((30, 5))
    panel = bench.page.search
    panel.start.click()
    assert "50.06% of the pixels with a spectrum" in panel.text.text()
    assert bench.page.image.overlay.isVisible()
    panel.what.setCurrentIndex(panel.what.findData(Seek.METAMERS))
    assert "look like pixel 30, 5" in panel.text.text()
    panel.angle.setValue(0.2)
    search = bench.state.search.value
    assert search is not None
    assert search.within_rad == 0.2
    panel.end.click()
    assert not bench.page.image.overlay.isVisible()


def test_every_view_paints_the_shape_of_the_result(bench: Bench) -> None:
    result = bench.state.result.value
    assert result is not None
    image = bench.page.image
    for view, quality in itertools.product(View, Quality):
        bench.state.quality.set(quality)
        bench.state.view.set(view)
        layer = Layers(result).layer(bench.state)
        assert layer is not None
        assert rgb_of(layer).shape == (24, 36, 3)
        assert image.legend.isVisible() == bool(layer.keys)
        assert image.image.image.shape[:2] == (24, 36)


def test_depth_outside_the_limits_is_transparent_and_the_bar_says_them(bench: Bench, qtbot: QtBot) -> None:
    bar, image = bench.page.bar, bench.page.image
    bench.control.show(View.COLOUR)
    assert not bar.near.isVisible()
    bench.control.show(View.DEPTH)
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


def test_the_band_line_and_the_slider_agree(bench: Bench) -> None:
    bench.control.show(View.BAND)
    bench.page.bar.slider.setValue(10)
    assert bench.state.band.value == 10
    assert bench.page.spectra.band_line.value() == NM[10]
    bench.page.spectra.band_line.setValue(611.0)
    assert bench.state.band.value == 36
    assert bench.page.bar.nm.text() == "610 nm"


def test_the_export_dialog_warns_before_it_replaces(bench: Bench, qtbot: QtBot, tmp_path: Path) -> None:
    dialog = ExportDialog(bench.state, bench.control, bench.page)
    qtbot.addWidget(dialog)
    assert dialog.write.isEnabled()
    assert not dialog.formats["csv"].isEnabled()
    (tmp_path / "small.ply").write_text("mine")
    dialog.formats["png"].setChecked(True)
    assert "small.ply exists already" in dialog.text.text()
    assert not dialog.write.isEnabled()
    dialog.replace.setChecked(True)
    dialog.folder.setText("/nowhere")
    assert "no folder" in dialog.text.text()
    dialog.folder.setText(str(tmp_path))
    dialog.write.click()
    assert (tmp_path / "small.ply").read_bytes().startswith(b"ply")
    assert (tmp_path / "small_rgb.png").exists()
    bench.window.do("export")
    opened = bench.page.findChildren(ExportDialog)
    assert opened
    for each in opened:
        each.close()


def test_the_intensity_graph_shows_orders_in_nm(bench: Bench) -> None:
    frames = np.linspace(60.0, 110.0, NM.size)
    measured = np.zeros((3, 200))
    measured[:, 150], measured[1, 80] = 100.0, 2.0
    graph = IntensityGraph((4, 5), measured, measured + 0.1, measured, 150.0, {1: frames}, NM)
    bench.state.graph.set(graph)
    window = bench.page.graph
    assert window.isVisible()
    assert "4, 5" in window.windowTitle()
    assert "First order +1 reaches the pixel" in window.text.text()
    assert [text for _, text in ticks(graph)] == ["450", "500", "550", "600", "650", "zero order"]
    assert window.item.viewRange()[1][1] < 5
    window.faint.setChecked(False)
    assert window.item.viewRange()[1][1] > 100
    bench.state.graph.set(replace(graph, model=None, orders={}, zero=None))
    assert "no model" in window.text.text()
    bench.state.graph.set(None)
    assert not window.isVisible()


def test_without_its_scan_a_graph_is_refused_in_words(bench: Bench) -> None:
    bench.window.do("intensity_graph")
    assert "Point at a pixel" in bench.window.toasts.shown[-1].text
    bench.control.point_at((3, 3))
    bench.window.do("intensity_graph")
    assert "not beside it" in bench.window.toasts.shown[-1].text


def test_themes_reach_every_panel(bench: Bench) -> None:
    bench.control.marks.pin((10, 10))
    for theme in (LIGHT, DARK_THEME):
        bench.page.apply_theme(theme)
        assert bench.page.image.canvas.backgroundBrush().color().name() == theme.base


def test_curves_are_dashed_where_the_prior_decides() -> None:
    share = np.array([0.1, 0.9, 0.9, 0.9, 0.2])
    solid, dashed = split_by_share(np.arange(5.0), share)
    assert np.isfinite(solid).tolist() == [False, True, True, True, False]
    assert np.isfinite(dashed).tolist() == [True, True, False, True, True]


def test_a_still_picture_shows_near_points_before_far_ones() -> None:
    points = np.array([[0, 0, 900], [0, 0, 700], [50, 40, 800], [-50, -40, 800]], np.float32)
    colours = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]], np.uint8)
    picture = still_picture(points, colours, "#102030")
    assert picture is not None
    assert picture.shape == (480, 640, 3)
    assert (picture == (0, 255, 0)).all(2).any()
    assert still_picture(points[:0], colours[:0], "#000000") is None


def test_a_result_that_is_closed_leaves_no_copy_behind(bench: Bench, qtbot: QtBot) -> None:
    bench.control.show(View.CLOUD)
    qtbot.waitUntil(lambda: bench.page.scene.scene is not None)
    QTest.qWait(50)
    bench.control.show(View.COLOUR)
    result = weakref.ref(bench.state.result.value)
    assert result() is not None
    bench.state.result.set(None)
    gc.collect()
    assert result() is None


def _cloud(bench: Bench, qtbot: QtBot) -> TurnedScene:
    """The 3D view with its points."""
    if not graphics_work():
        pytest.skip("nothing draws in 3D here")
    bench.control.show(View.CLOUD)
    qtbot.waitUntil(lambda: bench.page.scene.scene is not None)
    scene = bench.page.scene.scene
    assert isinstance(scene, TurnedScene)
    qtbot.waitUntil(lambda: scene.shown > 0 and scene.is_at_rest)
    return scene


def test_the_cloud_hides_what_lies_outside_the_limits_and_keeps_its_view(bench: Bench, qtbot: QtBot) -> None:
    scene = _cloud(bench, qtbot)
    assert scene.shown == 24 * 36 - 1
    scene.widget.artist.turn(3, 0)
    qtbot.waitUntil(lambda: scene.is_at_rest)
    before = scene.projection()[:, 0].copy()
    bench.control.limit_depth((705.0, 710.0))
    qtbot.waitUntil(lambda: scene.shown == 24 * 11)
    qtbot.waitUntil(lambda: scene.is_at_rest)
    np.testing.assert_allclose(scene.projection()[:2, 0], before[:2])
    bench.control.limit_depth((1.0, 2.0))
    qtbot.waitUntil(lambda: scene.shown == 0)
    bench.control.limit_depth(None)
    qtbot.waitUntil(lambda: scene.shown == 24 * 36 - 1)


def test_the_cloud_and_the_picture_share_one_cursor(bench: Bench, qtbot: QtBot) -> None:
    scene = _cloud(bench, qtbot)
    widget = scene.widget
    middle = QPoint(widget.width() // 2, widget.height() // 2)
    spot = _place(bench, scene, (20, 8))
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

    monkeypatch.setattr(scene_panel, "prepare_scene", prepare)
    panel = bench.page.scene
    for words in ("was cancelled", "could not be prepared: no vtk"):
        bench.control.show(View.CLOUD)
        qtbot.waitUntil(lambda words=words: words in panel._hint.text())  # type: ignore[misc]
        bench.control.show(View.COLOUR)
    bench.control.show(View.CLOUD)
    qtbot.waitUntil(lambda: panel.scene is not None)
    bench.window.close()


def _place(bench: Bench, scene: TurnedScene, pixel: Pixel) -> QPoint:
    """Where the point of a pixel lies in the 3D view."""
    result = bench.state.result.value
    assert result is not None
    x, y = on_screen(result.at("points_mm", pixel)[None], scene.projection())[0][:2]
    return QPoint(round((1 + x) / 2 * scene.widget.width()), round((1 - y) / 2 * scene.widget.height()))


def _looks_alike(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Whether two views put all points to the same place; how deep they look does not matter."""
    return bool(np.allclose(a[[0, 1, 3]], b[[0, 1, 3]], rtol=1e-6, atol=1e-9))


def _picture(scene: TurnedScene) -> NDArray[np.uint8]:
    """What the 3D view shows, RGB."""
    seen = scene.widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(seen.constBits(), np.uint8).reshape(seen.height(), seen.bytesPerLine())
    return rows[:, : 3 * seen.width()].reshape(seen.height(), seen.width(), 3).copy()


def test_a_marked_point_is_drawn_where_the_mouse_finds_it(bench: Bench, qtbot: QtBot) -> None:
    scene = _cloud(bench, qtbot)
    result = bench.state.result.value
    assert result is not None
    scene.show_marker(result.at("points_mm", (20, 8)), "#ff00ff")
    qtbot.waitUntil(lambda: scene.is_at_rest)
    spots = np.argwhere((_picture(scene) == (255, 0, 255)).all(2))
    place = _place(bench, scene, (20, 8))
    assert spots.mean(0) == pytest.approx((place.y(), place.x()), abs=2)


@pytest.mark.parametrize("way", ["mouse", "arrow key", "wheel", "plus key"])
def test_the_view_is_turned_and_looks_as_the_camera_again(bench: Bench, qtbot: QtBot, way: str) -> None:
    scene = _cloud(bench, qtbot)
    first, middle = scene.projection(), scene.widget.rect().center()
    if way == "mouse":
        QTest.mousePress(scene.widget, Qt.MouseButton.LeftButton, pos=middle)
        move(scene.widget, middle + QPoint(40, 9), Qt.MouseButton.LeftButton)
        QTest.mouseRelease(scene.widget, Qt.MouseButton.LeftButton, pos=middle + QPoint(40, 9))
    elif way == "wheel":
        at = QPointF(middle)
        turned = QWheelEvent(at, at, QPoint(), QPoint(0, 120), Qt.MouseButton.NoButton,
                             Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False)  # fmt: skip
        QApplication.sendEvent(scene.widget, turned)
    else:
        QTest.keyClick(scene.widget, Qt.Key.Key_Right if way == "arrow key" else Qt.Key.Key_Plus)
    qtbot.waitUntil(lambda: scene.is_at_rest and not _looks_alike(scene.projection(), first))
    QTest.keyClick(scene.widget, Qt.Key.Key_Home)
    qtbot.waitUntil(lambda: scene.is_at_rest and _looks_alike(scene.projection(), first))


def test_pictures_follow_the_size_of_the_window(bench: Bench, qtbot: QtBot) -> None:
    scene = _cloud(bench, qtbot)
    # A sliver: who has not turned the view sees all of the cloud in it.
    scene.widget.setFixedWidth(90)
    qtbot.waitUntil(lambda: scene.is_at_rest and scene.widget.image.width() == 90)
    assert scene.widget.image.height() == scene.widget.height()
    for pixel in ((0, 0), (35, 23)):
        assert scene.widget.rect().contains(_place(bench, scene, pixel))


def test_pictures_are_as_fine_as_the_screen(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = _cloud(bench, qtbot)
    monkeypatch.setattr(scene.widget, "devicePixelRatioF", lambda: 1.5)
    QApplication.sendEvent(scene.widget, QEvent(QEvent.Type.DevicePixelRatioChange))
    width = round(1.5 * scene.widget.width())
    qtbot.waitUntil(lambda: scene.is_at_rest and scene.widget.image.width() == width)
    assert scene.widget.image.devicePixelRatio() == 1.5


def test_a_large_cloud_grows_to_its_last_point(
    bench: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    # However slow the machine.
    monkeypatch.setattr(cloud, "SLOW_S", 100.0)
    scene = _cloud(bench, qtbot)
    points = np.random.default_rng(0).normal((0, 0, 700), 20, (cloud.COARSE + 9, 3)).astype(np.float32)
    scene.show_cloud(points, np.zeros((len(points), 3), np.uint8))
    qtbot.waitUntil(lambda: scene.is_at_rest and scene.shown == len(points))


def test_who_turns_the_cloud_is_not_slowed_down_by_what_moves(bench: Bench, qtbot: QtBot) -> None:
    scene = _cloud(bench, qtbot)
    middle, point = scene.widget.rect().center(), np.array([0, 0, 700], np.float32)
    scene.show_marker(point, "#ff0000")
    QTest.mousePress(scene.widget, Qt.MouseButton.LeftButton, pos=middle)
    scene.show_marker(point + 1, "#ff0000")
    # Unlike QTest.qWait, this lets other threads run.
    qtbot.wait(int(2000 * SETTLE_S))
    assert scene._artist._easel.cloud.is_coarse
    QTest.mouseRelease(scene.widget, Qt.MouseButton.LeftButton, pos=middle)
    qtbot.waitUntil(lambda: not scene._artist._easel.cloud.is_coarse)


def test_the_thread_that_draws_ends_with_the_window(bench: Bench, qtbot: QtBot) -> None:
    scene = _cloud(bench, qtbot)
    assert any(thread.name == "3d-view" for thread in threading.enumerate())
    scene._artist._ask(lambda: time.sleep(0.3))
    bench.window.close()
    assert not any(thread.name == "3d-view" for thread in threading.enumerate())
    scene.show_marker(None, "#ff0000")
