"""Scans and results are opened as things, by double click and by the button."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.shared.widgets.open_dialog import ALL, SCANS, OpenDialog, is_thing
from PySide6.QtCore import QFileInfo
from PySide6.QtWidgets import QLineEdit, QTreeView
from pytestqt.qtbot import QtBot

from tests.app.support.locked import lock


@pytest.fixture
def home(tmp_path: Path) -> Path:
    for name, content in (("leaf.dsl", "manifest.json"), ("leaf.zarr", "zarr.json"), ("plain", "notes.txt")):
        (tmp_path / name).mkdir()
        (tmp_path / name / content).write_text("{}")
    return tmp_path


def _dialog(qtbot: QtBot, home: Path, takes_folders: bool = False) -> OpenDialog:
    dialog = OpenDialog(None, "Open", str(home), takes_folders)
    qtbot.addWidget(dialog)
    return dialog


@pytest.mark.slow
@pytest.mark.parametrize("name", ["leaf.dsl", "leaf.zarr"])
def test_a_thing_is_chosen_and_not_entered(qtbot: QtBot, home: Path, name: str) -> None:
    assert is_thing(home / name)
    by_button = _dialog(qtbot, home)
    by_button.selectFile(str(home / name))
    by_button.accept()
    assert by_button.chosen == home / name
    by_click = _dialog(qtbot, home)
    by_click.directoryEntered.emit(str(home / name))
    assert by_click.chosen == home / name
    assert by_click.result() == OpenDialog.DialogCode.Accepted
    assert by_click._icons.type(QFileInfo(str(home / name))) in ("Scan", "Result")


def test_a_folder_is_entered_and_a_file_chosen(qtbot: QtBot, home: Path) -> None:
    assert not is_thing(home / "plain")
    dialog = _dialog(qtbot, home)
    dialog.selectFile(str(home / "plain"))
    dialog.accept()
    assert dialog.chosen is None
    dialog = _dialog(qtbot, home)
    dialog.directoryEntered.emit(str(home / "plain"))
    assert dialog.chosen is None
    dialog.setDirectory(str(home / "plain"))
    dialog.selectFile(str(home / "plain" / "notes.txt"))
    dialog.accept()
    assert dialog.chosen == home / "plain" / "notes.txt"


def test_who_walked_into_a_thing_all_the_same_gets_it(qtbot: QtBot, home: Path) -> None:
    dialog = _dialog(qtbot, home / "leaf.dsl")
    dialog.selectFile(str(home / "leaf.dsl" / "manifest.json"))
    dialog.accept()
    assert dialog.chosen == home / "leaf.dsl"


def test_any_folder_may_be_meant(qtbot: QtBot, home: Path) -> None:
    dialog = _dialog(qtbot, home, takes_folders=True)
    dialog.selectFile(str(home / "plain"))
    dialog.accept()
    assert dialog.chosen == home / "plain"


def test_a_folder_is_chosen_by_itself_or_by_what_lies_in_it(
    qtbot: QtBot, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen: Path | None = None
    monkeypatch.setattr(OpenDialog, "exec", lambda self: setattr(self, "chosen", chosen))
    for chosen in (home / "plain", home / "plain" / "notes.txt", None):
        assert OpenDialog.ask_folder(None, "Import", str(home)) == (
            None if chosen is None else home / "plain"
        )
    dialog = OpenDialog(None, "Import", str(home / "plain"), takes_folders=True, filters=(ALL,))
    qtbot.addWidget(dialog)
    dialog.selectFile(str(home / "plain" / "notes.txt"))
    dialog.accept()
    assert dialog.chosen == home / "plain" / "notes.txt"


def test_a_folder_that_is_not_there_yet_is_no_name_that_was_typed(qtbot: QtBot, home: Path) -> None:
    dialog = _dialog(qtbot, home / "dsl-scans", takes_folders=True)
    assert dialog.directory().absolutePath() == str(home)
    typed = dialog.findChild(QLineEdit)
    assert typed is not None
    assert typed.text() == ""


def test_a_filter_shows_scans_or_results_alone(qtbot: QtBot, home: Path) -> None:
    dialog = OpenDialog(None, "Open", str(home), takes_folders=False, filters=(SCANS, ALL))
    qtbot.addWidget(dialog)
    dialog.show()
    listed = dialog.findChild(QTreeView)
    assert listed is not None

    def names() -> set[str]:
        model, root = listed.model(), listed.rootIndex()
        return {str(model.index(row, 0, root).data()) for row in range(model.rowCount(root))}

    qtbot.waitUntil(lambda: names() == {"leaf.dsl", "plain"})
    dialog.filterSelected.emit(ALL)
    qtbot.waitUntil(lambda: names() == {"leaf.dsl", "leaf.zarr", "plain"})


def test_folders_that_may_not_be_entered_are_folders(
    qtbot: QtBot, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lock(monkeypatch, home / "leaf.zarr")
    assert not is_thing(home / "leaf.zarr")
    dialog = _dialog(qtbot, home)
    info = QFileInfo(str(home / "leaf.zarr"))
    assert not dialog._icons.icon(info).isNull()
    assert dialog._icons.type(info) not in ("Scan", "Result")
