"""Pages use the room of a large window, and come back from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path

import pytest
from dsl_app.calibrate.page import CalibratePage
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.results.page import ResultsPage
from dsl_app.results.state import Tool
from dsl_app.rig.page import RigPage
from dsl_app.scan.page import ScanPage
from dsl_app.shared.widgets.read_table import ReadTable
from dsl_app.shell.main_window import MainWindow
from dsl_app.shell.paged_window import LEAST
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QApplication,
    QPushButton,
    QTabBar,
    QToolButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from tests.app.support.real_window import show_window
from tests.app.support.small_result import write_small_result

#: What a person presses or reads in rows.
PARTS = (QAbstractButton, QAbstractItemView)
#: What of it may be beyond an edge: no text is there, px.
EDGE_PX = 2
PAGES = ("rig", "scan", "calibrate", "results")
HUGE, LARGE, SMALL = (2560, 1440), (1920, 1080), (1280, 800)
#: A laptop of 1280 x 800 px at one and a half times the size, less the frame of a window.
MAGNIFIED = (845, 493)


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> MainWindow:
    made = Composition(StartOptions()).open_window(tmp_path / "home")
    show_window(qtbot, made)
    return made


def results_of(window: MainWindow, qtbot: QtBot, folder: Path) -> ResultsPage:
    """The page of a small result, in a window that may be as small as any."""
    window.setMinimumSize(LEAST)
    window.open_path(write_small_result(folder))
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=30_000)
    page = window.open_page("results")
    assert isinstance(page, ResultsPage)
    return page


@pytest.mark.slow
def test_views_are_side_by_side_in_a_large_window_alone(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    rig, scan, calibrate, results = (window.page_of(name) for name in PAGES)
    assert isinstance(rig, RigPage)
    assert isinstance(scan, ScanPage)
    assert isinstance(calibrate, CalibratePage)
    assert isinstance(results, ResultsPage)
    window.open_path(write_small_result(tmp_path))
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=30_000)
    live = rig.live.content
    for size in (SMALL, LARGE, HUGE, SMALL):
        is_large, is_tall = size != SMALL, size == HUGE
        window.resize(*size)
        for name in PAGES:
            window.open_page(name)
            assert window.size().toTuple() == size, f"{name} does not fit"
            assert window.page_of(name).is_wide == is_large
        assert (live.controls.parent() is rig.beside) == is_large
        tabs = [scan.middle.widget(place) for place in range(scan.middle.count())]
        assert (scan.view not in tabs) == is_large
        # What is said of the last frame is below it, where it needs no scrolling.
        assert (scan.frame.parent() is scan.view.parent()) == is_large
        assert scan.run.window() is window
        beside = calibrate.library.mapTo(calibrate, calibrate.library.rect().topLeft())
        rows = calibrate.rows["selftest"].mapTo(calibrate, calibrate.rows["selftest"].rect().topRight())
        assert (beside.x() > rows.x()) == is_large
        # Figures are read in one line next to their calibration, and the histogram grows with the window.
        if is_large:
            assert is_tall or calibrate.library.details.y() > calibrate.library.table.y()
            assert 1.1 < calibrate.rows["selftest"].width() / calibrate.library.width() < 1.6
        # In a high one all that is set and read is in one column, which it fills.
        assert not is_large or (rig.beside.parentWidget() is rig.projector.parentWidget()) == is_tall
        tables = (scan.forecast.table, scan.forecast), (calibrate.library.table, calibrate.library)
        for table, usual in tables:
            assert usual.isAncestorOf(table) != is_tall
        if is_tall:
            lowest = (rig.beside, scan.forecast.table, calibrate.library.table)
            for name, low in zip(PAGES, lowest, strict=False):
                window.open_page(name)
                qtbot.waitUntil(partial(_fills_the_left, window.page_of(name), low))
        # The picture gets what a wide window has more of.
        share = results._sides.sizes()[0] / sum(results._sides.sizes())
        assert (share > 0.7) == is_large
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=30_000)
    window.close()


def test_what_is_made_in_a_large_window_has_its_colours(qtbot: QtBot, tmp_path: Path) -> None:
    """Parts that stand elsewhere in a large window would otherwise keep the colours of a dark one."""
    window = Composition(StartOptions()).open_window(tmp_path / "home", "light")
    show_window(qtbot, window)
    window.resize(*HUGE)
    calibrate = window.open_page("calibrate")
    assert isinstance(calibrate, CalibratePage)
    qtbot.waitUntil(lambda: calibrate._library.made is not None)
    tables = window.findChildren(ReadTable)
    assert calibrate.library.table in tables
    assert not [table.accessibleName() for table in tables if table.theme is not window.theme]
    window.close()


@pytest.mark.slow
def test_what_comes_next_is_seen_on_a_magnified_screen(window: MainWindow, qtbot: QtBot) -> None:
    window.setMinimumSize(LEAST)
    scan = window.page_of("scan")
    assert isinstance(scan, ScanPage)
    for size in (MAGNIFIED, SMALL, MAGNIFIED):
        window.resize(*size)
        for key in window.pages:
            page = window.open_page(key)
            QApplication.processEvents()
            assert window.size().toTuple() == size, f"{key} does not fit"
            buttons = page.findChildren(QPushButton)
            blue = [each for each in buttons if each.isVisible() and each.property("role") == "primary"]
            assert blue or key not in ("start", "rig", "scan"), key
            hidden = [each.text() for each in blue if each.visibleRegion().boundingRect() != each.rect()]
            assert not hidden, f"{key}: {hidden}"
        # A side that scrolls takes more height than it needs, so that it does so only where it must.
        rig = window.page_of("rig")
        assert isinstance(rig, RigPage)
        assert (rig._left_side.parentWidget() is rig) == (size == SMALL)
        # The plan is the first of the views where it has no column of its own.
        assert (scan.middle.indexOf(scan._left_area) == 0) == (size == MAGNIFIED)
        titles = [scan.middle.tabText(place) for place in range(scan.middle.count())]
        assert len(titles) == len(set(titles)) == 3 + (size == MAGNIFIED)


@pytest.mark.slow
def test_nothing_is_cut_or_covered_on_a_magnified_screen(
    window: MainWindow, qtbot: QtBot, tmp_path: Path
) -> None:
    window.setMinimumSize(LEAST)
    window.open_path(write_small_result(tmp_path))
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=30_000)
    for size in (MAGNIFIED, SMALL):
        window.resize(*size)
        for key in window.pages:
            page = window.open_page(key)
            QApplication.processEvents()
            parts = [each for each in page.findChildren(QWidget) if isinstance(each, PARTS)]
            # The arrows of a row of tabs lie over it.
            seen = [each for each in parts if _is_seen(each) and not isinstance(each.parent(), QTabBar)]
            assert not [_text(each) for each in seen if _seen_px(each) < each.width() - EDGE_PX], (
                f"{key} {size}: cut"
            )
            assert not list(_covering(seen)), f"{key} {size}: one over the other"
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=30_000)


def test_no_word_on_a_view_is_cut_where_the_bar_is_narrow(
    window: MainWindow, qtbot: QtBot, tmp_path: Path
) -> None:
    page = results_of(window, qtbot, tmp_path)
    rows = {}
    for size in (MAGNIFIED, LARGE):
        window.resize(*size)
        QApplication.processEvents()
        views, pin = page.bar.views.values(), page.bar.tools[Tool.PIN]
        cut = [each.text() for each in views if each.width() < each.sizeHint().width()]
        assert not cut, size
        rows[size] = pin.mapTo(page, QPoint()).y() - next(iter(views)).mapTo(page, QPoint()).y()
    assert rows[MAGNIFIED] > 10, "tools are below the views where there is no room beside them"
    assert abs(rows[LARGE]) < 5, "and beside them where there is"


@pytest.mark.slow
def test_spectra_are_read_with_any_tab_on_a_magnified_screen(
    window: MainWindow, qtbot: QtBot, tmp_path: Path
) -> None:
    page = results_of(window, qtbot, tmp_path)
    window.resize(*MAGNIFIED)
    window.do("view_cloud")
    page._state.cursor.set((3, 3))
    for each in (page.materials, page.colours, page.search):
        _ = each.content
    QApplication.processEvents()
    bar = next(each for each in page.findChildren(QTabBar) if each.accessibleName() == "Marks and answers")
    assert not [each for each in bar.findChildren(QToolButton) if each.isVisible()], "tabs have arrows"
    for tab in range(bar.count()):
        bar.setCurrentIndex(tab)
        QApplication.processEvents()
        assert page.spectra.height() > 0.35 * page._sides.height(), bar.tabText(tab)
    values = page.pixel_info.values
    assert "nm" in values.text()
    assert values.height() >= values.heightForWidth(values.width())
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=30_000)


def test_pages_are_chosen_by_their_icons_where_their_names_have_no_room(window: MainWindow) -> None:
    window.setMinimumSize(LEAST)
    button = window.rail.findChildren(QToolButton)[0]
    for size, style in (
        (SMALL, Qt.ToolButtonStyle.ToolButtonTextUnderIcon),
        ((845, 360), Qt.ToolButtonStyle.ToolButtonIconOnly),
    ):
        window.rail.resize(84, size[1])
        assert button.toolButtonStyle() is style


def _is_seen(part: QWidget) -> bool:
    return not part.visibleRegion().isEmpty()


def _text(part: QWidget) -> str:
    return part.text() if isinstance(part, QAbstractButton) else part.accessibleName()


def _seen_px(part: QWidget) -> int:
    return part.visibleRegion().boundingRect().width()


def _covering(parts: Sequence[QWidget]) -> Iterator[tuple[str, str]]:
    """Parts of one widget that share a place."""
    for one, other in combinations(parts, 2):
        if one.parent() is other.parent() and one.geometry().intersects(other.geometry()):
            yield _text(one), _text(other)


def _fills_the_left(page: QWidget, low: QWidget) -> bool:
    """Whether something is at the left edge of a page and ends near its lower one."""
    corner = low.mapTo(page, low.rect().bottomLeft())
    return corner.x() < 0.1 * page.width() and corner.y() > 0.8 * page.height()
