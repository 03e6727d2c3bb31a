"""Answers to questions that windows ask while tests close them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication, QDialog, QMessageBox

#: How often it is looked for a question, ms.
LOOK_MS = 100


@contextmanager
def answering_questions() -> Iterator[None]:
    """Let whatever is asked go on meanwhile: jobs are stopped, and what is not saved is dropped."""
    if QApplication.instance() is None:
        yield
        return
    timer = QTimer(interval=LOOK_MS)
    timer.timeout.connect(_answer)
    timer.start()
    try:
        yield
    finally:
        timer.stop()


def _answer() -> None:
    asked = QApplication.activeModalWidget()
    if isinstance(asked, QMessageBox):
        for button in asked.buttons():
            if asked.buttonRole(button) is QMessageBox.ButtonRole.AcceptRole:
                button.click()
                return
    if isinstance(asked, QDialog):
        asked.reject()
