"""No test of the window waits for ever for an answer that nobody gives."""

from __future__ import annotations

import pytest
from dsl_app.shared.widgets.dialogs import confirm
from dsl_app.shared.widgets.open_dialog import OpenDialog
from PySide6.QtWidgets import QFileDialog, QWidget
from pytestqt.qtbot import QtBot

from tests.app.support.questions import no_dialog_waits_for_ever


def test_a_dialog_that_nobody_answers_is_given_up(qtbot: QtBot) -> None:
    parent = QWidget()
    qtbot.addWidget(parent)
    with no_dialog_waits_for_ever(50) as given_up:
        assert not confirm(parent, "A question", "Go on?", go="Go", stay="Stay")
        assert OpenDialog.ask(parent, "A file") is None
    assert given_up == ["A question", "A file"]


def test_a_file_dialog_has_to_be_answered(qtbot: QtBot) -> None:
    with pytest.raises(AssertionError, match="chooses nothing"):
        QFileDialog.getOpenFileName(None, "A plan")
