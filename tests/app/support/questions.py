"""Answers to questions that windows ask while tests close them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog, QMessageBox

_execute = QDialog.exec

#: How often it is looked for a question, ms.
LOOK_MS = 100
#: How long a dialog may wait for its answer before it is given up, ms: a test that answers does so at once.
LONGEST_MS = 30_000


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


@contextmanager
def no_dialog_waits_for_ever(longest_ms: int = LONGEST_MS) -> Iterator[list[str]]:
    """Give up dialogs that nobody answers, and yield their titles as they come.

    A dialog runs a loop of its own, in which no signal of a time limit reaches Python. The file dialogs of
    the system cannot be given up: a test that comes to one has to choose for it.
    """
    given_up: list[str] = []

    def execute(dialog: QDialog) -> int:
        late = QTimer(interval=longest_ms, singleShot=True)

        def give_up() -> None:
            given_up.append(dialog.windowTitle())
            dialog.reject()

        late.timeout.connect(give_up)
        late.start()
        try:
            return _execute(dialog)
        finally:
            late.stop()

    def choose(*about: object, **_: object) -> NoReturn:
        raise AssertionError(f"This test chooses nothing in the file dialog {about[1:2]}.")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(QDialog, "exec", execute)
        for name in ("getOpenFileName", "getSaveFileName", "getExistingDirectory"):
            patch.setattr(QFileDialog, name, choose)
        yield given_up


def _answer() -> None:
    asked = QApplication.activeModalWidget()
    if isinstance(asked, QMessageBox):
        for button in asked.buttons():
            if asked.buttonRole(button) is QMessageBox.ButtonRole.AcceptRole:
                button.click()
                return
    if isinstance(asked, QDialog):
        asked.reject()
