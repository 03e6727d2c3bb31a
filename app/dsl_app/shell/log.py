"""The log dock: messages of the program, with a filter."""

from __future__ import annotations

import logging
from collections import deque

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QApplication, QLabel, QLineEdit, QPlainTextEdit, QWidget

from dsl_app.shared.widgets.forms import ChoiceBox, named, push_button
from dsl_app.shared.widgets.layouts import column_of, row_of

MOST_LINES = 5000
LEVELS = (("Everything", logging.DEBUG), ("Information", logging.INFO), ("Warnings", logging.WARNING))


class LogRecords(QObject, logging.Handler):
    """Passes log records of any thread to the window's thread, where the last ones are kept."""

    arrived = Signal(int, str)
    _sent = Signal(int, str)

    def __init__(self, parent: QObject | None = None) -> None:
        QObject.__init__(self, parent)
        logging.Handler.__init__(self, logging.DEBUG)
        self.setFormatter(logging.Formatter("%(asctime)s  %(levelname)-7s  %(name)s  %(message)s"))
        self.lines: deque[tuple[int, str]] = deque(maxlen=MOST_LINES)
        self._sent.connect(self._keep)

    def emit(self, record: logging.LogRecord) -> None:  # type: ignore[override]
        """Pass a record on."""
        self._sent.emit(record.levelno, self.format(record))

    def _keep(self, level: int, text: str) -> None:
        """Keep a line, in the window's thread: who reads them there and hears of new ones has each once."""
        self.lines.append((level, text))
        self.arrived.emit(level, text)


class LogPanel(QWidget):
    """Shows the records at or above a level that contain a text."""

    def __init__(self, records: LogRecords, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._records = records
        self._level = ChoiceBox("Lowest level shown", "Hide messages below this level", LEVELS)
        self._level.setCurrentIndex(1)
        self._filter = named(QLineEdit(), "Filter by text", "Show only messages that contain this text")
        self._filter.setPlaceholderText("Filter by text")
        self._filter.setClearButtonEnabled(True)
        copy = push_button("Copy", "Copy the shown lines to the clipboard")
        self.view = QPlainTextEdit()
        self.view.setObjectName("log")
        self.view.setReadOnly(True)
        self.view.setMaximumBlockCount(MOST_LINES)
        self.view.setAccessibleName("Log")
        self.view.setToolTip("What the program did and what went wrong, the latest at the bottom")
        row = row_of(QLabel("Show"), self._level, self._filter, copy)
        column_of(row, self.view, on=self)
        self._level.currentIndexChanged.connect(self._refill)
        self._filter.textChanged.connect(self._refill)
        copy.clicked.connect(lambda: QApplication.clipboard().setText(self.view.toPlainText()))
        records.arrived.connect(self._add)
        self._refill()

    def _matches(self, level: int, text: str) -> bool:
        return level >= int(self._level.currentData()) and self._filter.text().lower() in text.lower()

    def _add(self, level: int, text: str) -> None:
        if self._matches(level, text):
            self.view.appendPlainText(text)
        self._say_why_empty()

    def _refill(self) -> None:
        lines = [text for level, text in self._records.lines if self._matches(level, text)]
        self.view.setPlainText("\n".join(lines))
        self._say_why_empty()

    def _say_why_empty(self) -> None:
        hidden = len(self._records.lines) > 0
        self.view.setPlaceholderText(
            "No message has the level and the text chosen above." if hidden else "No messages yet."
        )
