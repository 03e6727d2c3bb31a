"""A file gets the ending of its format, and is replaced only if the dialog asked about that very name."""

from pathlib import Path

import pytest
from dsl_app.shared.widgets.save_dialog import ask_target
from PySide6.QtWidgets import QFileDialog, QWidget
from pytestqt.qtbot import QtBot

KINDS = "HTML page (*.html);;PDF (*.pdf)"


@pytest.mark.parametrize(
    ("typed", "kind", "target"),
    [
        ("a.html", "HTML page (*.html)", (Path("a.html"), True)),
        ("a.PDF", "HTML page (*.html)", (Path("a.PDF"), True)),
        ("a", "PDF (*.pdf)", (Path("a.pdf"), False)),
        ("a.b", "", (Path("a.b.html"), False)),
        ("", "", None),
    ],
)
def test_a_name_has_an_ending_of_its_kind(
    qtbot: QtBot,
    monkeypatch: pytest.MonkeyPatch,
    typed: str,
    kind: str,
    target: tuple[Path, bool] | None,
) -> None:
    parent = QWidget()
    qtbot.addWidget(parent)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (typed, kind))
    assert ask_target(parent, "Write", "draft.html", KINDS) == target
