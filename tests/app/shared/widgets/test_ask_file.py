"""Dialogs for files begin where the last one ended, and first of all among the person's documents."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.shared.widgets import ask_file as module
from dsl_app.shared.widgets.ask_file import ask_file, ask_folder, start_folder
from PySide6.QtCore import QStandardPaths
from PySide6.QtWidgets import QFileDialog, QWidget
from pytestqt.qtbot import QtBot


def test_dialogs_begin_in_documents_and_then_where_the_last_choice_was(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    documents, library = tmp_path / "documents", tmp_path / "library"
    documents.mkdir()
    library.mkdir()
    monkeypatch.setattr(module, "_last", [])
    monkeypatch.setattr(QStandardPaths, "writableLocation", lambda _: str(documents))
    began: list[str] = []

    def choose(_parent: QWidget, _title: str, folder: str, *_: str) -> tuple[str, str]:
        began.append(folder)
        return str(library / "leaf.csv"), ""

    monkeypatch.setattr(QFileDialog, "getOpenFileName", choose)
    parent = QWidget()
    qtbot.addWidget(parent)
    assert ask_file(parent, "A file", "All (*)") == library / "leaf.csv"
    ask_file(parent, "A file", "All (*)")
    ask_file(parent, "A file", "All (*)", str(documents))
    assert began == [str(documents), str(library), str(documents)]
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: "")
    assert ask_folder(parent, "A folder") is None
    library.rmdir()
    assert start_folder() == str(documents), "that folder is no more"
