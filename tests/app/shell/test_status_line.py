"""Hints in the status bar next to jobs and messages."""

from __future__ import annotations

from dsl_app.shell.status_line import GAP_PX, StatusLine
from PySide6.QtGui import QPaintEvent
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

HINT = "Click or press Enter to pin a spectrum; drag to pan, wheel to zoom; arrow keys move the cursor"


def test_a_hint_ends_in_an_ellipsis_before_a_job(qtbot: QtBot) -> None:
    line = StatusLine()
    qtbot.addWidget(line)
    line.resize(1200, 30)
    job = QLabel("Materials by marks · compare with the classes")
    job.setFixedWidth(900)
    line.addPermanentWidget(job)
    job.hide()
    line.show()
    line.showMessage(HINT)
    assert line.shown_text == HINT
    job.show()
    qtbot.waitUntil(lambda: job.x() > 0)
    assert line.room.right() < job.x() - GAP_PX + 1
    assert line.shown_text.endswith("…")
    assert HINT.startswith(line.shown_text[:-1])
    assert line.fontMetrics().horizontalAdvance(line.shown_text) <= line.room.width()
    line.clearMessage()
    assert line.shown_text == ""


class Watched(StatusLine):
    """A status line that keeps how far left each painting went."""

    def __init__(self) -> None:
        super().__init__()
        self.lefts: list[int] = []

    def paintEvent(self, event: QPaintEvent) -> None:
        self.lefts.append(event.rect().left())
        super().paintEvent(event)


def test_a_hint_with_more_room_is_painted_whole_and_not_only_where_room_came(qtbot: QtBot) -> None:
    line = Watched()
    qtbot.addWidget(line)
    line.resize(1200, 30)
    job = QLabel("Predict the accuracy", line)
    job.setGeometry(400, 0, 700, 30)
    line.show()
    line.showMessage(HINT)
    qtbot.waitUntil(lambda: bool(line.lefts))
    qtbot.wait(20)
    assert line.shown_text.endswith("…")
    line.lefts.clear()
    job.move(900, 0)
    assert line.shown_text == HINT
    qtbot.waitUntil(lambda: 0 in line.lefts, timeout=1000)
