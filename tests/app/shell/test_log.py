"""The log dock: lines of any thread exactly once, and an empty view that says why."""

from __future__ import annotations

import logging
import threading

from dsl_app.shell.log import LogPanel, LogRecords
from PySide6.QtCore import QCoreApplication
from pytestqt.qtbot import QtBot


def _message(text: str) -> logging.LogRecord:
    return logging.LogRecord("dsl_core", logging.WARNING, __file__, 1, text, None, None)


def test_message_of_a_thread_is_shown_once_when_the_panel_is_filled_before_it_arrives(qtbot: QtBot) -> None:
    records = LogRecords()
    thread = threading.Thread(target=records.handle, args=(_message("the stage has stopped"),))
    thread.start()
    thread.join()
    panel = LogPanel(records)
    qtbot.addWidget(panel)
    QCoreApplication.processEvents()
    assert panel.view.toPlainText().count("the stage has stopped") == 1
    assert len(records.lines) == 1


def test_filtered_log_does_not_say_that_there_are_no_messages(qtbot: QtBot) -> None:
    records = LogRecords()
    panel = LogPanel(records)
    qtbot.addWidget(panel)
    assert panel.view.placeholderText() == "No messages yet."
    records.handle(_message("the stage has stopped"))
    panel._filter.setText("camera")
    assert panel.view.toPlainText() == ""
    assert panel.view.placeholderText() != "No messages yet."
