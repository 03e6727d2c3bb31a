"""Hints in the status bar next to jobs and messages."""

from __future__ import annotations

from dsl_app.shell.status_line import GAP_PX, StatusLine
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
