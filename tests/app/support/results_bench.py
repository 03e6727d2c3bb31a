"""A window with the Results page alone, for tests that use mouse and keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from dsl_app.results.controller import ResultsController
from dsl_app.results.page import ResultsPage
from dsl_app.results.state import Mark, ResultsState
from dsl_app.results.welcome import Welcome
from dsl_app.shared.evented import Value
from dsl_app.shared.spectrum import Pixel
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shell.application import make_window, open_first_page
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from tests.app.support.doubles import InlineRunner
from tests.app.support.small_result import write_small_result


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
        window, runner = self.window, InlineRunner(self.window.toasts)
        self.control = ResultsController(self.state, runner, window.toasts, window.parts.undo)
        welcome = Welcome(
            window.parts.recent, window.open_path, lambda: self.asked.append("demo"), Value(False)
        )
        self.page = ResultsPage(self.state, self.control, runner, welcome)
        self.page.apply_theme(window.theme)
        return self.page

    @property
    def view(self) -> QWidget:
        viewport: QWidget = self.page.image.content.canvas.viewport()
        return viewport

    def at(self, pixel: Pixel) -> QPoint:
        """Where a pixel of the image lies on the canvas."""
        image = self.page.image.content
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
    rooms = made.page.findChildren(Deferred)
    qtbot.waitUntil(lambda: all(room.made is not None for room in rooms if room.isVisible()))
    QTest.qWait(20)
    yield made
    made.window.close()


def select(bench: Bench, place: int) -> ResultsState:
    """Select the mark at a place."""
    bench.state.selected.set(bench.marks[place].key)
    return bench.state
