"""A file gets the ending of its format, and is replaced only if the dialog asked about that very name."""

from pathlib import Path

import pytest
from dsl_app.shared.widgets import save_dialog
from dsl_app.shared.widgets.save_dialog import ask_place, ask_target, with_ending
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


@pytest.mark.parametrize("answer", [True, False])
def test_a_person_is_asked_about_the_file_with_the_ending_that_is_added(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, answer: bool
) -> None:
    parent, asked = QWidget(), list[str]()
    qtbot.addWidget(parent)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "Plan v1.2"), ""))

    def answered(_: QWidget, title: str, text: str, **buttons: str) -> bool:
        asked.append(text)
        return answer

    monkeypatch.setattr(save_dialog, "confirm", answered)
    path = tmp_path / "Plan v1.2.html"
    assert ask_place(parent, "Write", "draft.html", KINDS) == path
    assert asked == []
    path.touch()
    assert ask_place(parent, "Write", "draft.html", KINDS) == (path if answer else None)
    assert asked == ["Plan v1.2.html already exists. Do you want to replace it?"]


def test_a_name_too_long_for_any_file_is_not_asked_about(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    parent, typed = QWidget(), tmp_path / ("a" * 253)
    qtbot.addWidget(parent)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(typed), ""))
    assert ask_place(parent, "Write", "draft.html", KINDS) == tmp_path / f"{typed.name}.html"


def test_a_folder_needs_no_ending() -> None:
    kinds = "Rig (*.json);;Published layout, a folder (*)"
    assert with_ending("a.v2", "Published layout, a folder (*)", kinds) == (Path("a.v2"), True)
    assert with_ending("a.v2", "Rig (*.json)", kinds) == (Path("a.v2.json"), False)
