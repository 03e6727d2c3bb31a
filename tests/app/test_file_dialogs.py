from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog, QLineEdit, QMainWindow, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from app.widgets import file_dialogs


def answer(act: Callable[[QFileDialog], object]) -> list[QFileDialog]:
    """Do something with the dialog that comes, and keep it."""
    seen: list[QFileDialog] = []

    def come() -> None:
        dialog = QApplication.activeModalWidget()
        assert isinstance(dialog, QFileDialog)
        seen.append(dialog)
        act(dialog)

    QTimer.singleShot(50, come)
    return seen


def type_and_accept(text: str) -> Callable[[QFileDialog], None]:
    def act(dialog: QFileDialog) -> None:
        line = dialog.findChild(QLineEdit)
        assert line is not None
        assert line.text() == ""
        line.setText(text)
        dialog.accept()

    return act


def test_one_dialog_asks_for_everything_and_forgets_the_last_answer(qtbot: QtBot, tmp_path: Path) -> None:
    window = QMainWindow()
    qtbot.addWidget(window)
    window.show()
    plan, folder = tmp_path / "plan.json", tmp_path / "scans"
    plan.write_text("{}")
    folder.mkdir()
    seen = answer(type_and_accept("plan.json"))
    found = file_dialogs.open_file(window, "Open a plan", str(tmp_path), "Plans (*.json);;All files (*)")
    assert found == (str(plan), "Plans (*.json)")
    seen += answer(type_and_accept(str(folder)))
    assert file_dialogs.choose_folder(window, "Store scans in", str(tmp_path)) == str(folder)
    draft = str(tmp_path / "new.csv")
    seen += answer(lambda dialog: dialog.accept())
    assert file_dialogs.save_file(window, "Export", draft, "Spectra (*.csv)") == (draft, "Spectra (*.csv)")
    seen += answer(lambda dialog: dialog.reject())
    assert file_dialogs.open_file(window, "Open", str(tmp_path)) == ("", "")
    seen += answer(lambda dialog: dialog.reject())
    assert file_dialogs.choose_folder(window, "Export to") == ""
    assert all(dialog is seen[0] for dialog in seen)


def test_the_dialog_stands_before_who_asks_and_outlives_it(qtbot: QtBot, tmp_path: Path) -> None:
    window = QMainWindow()
    qtbot.addWidget(window)
    window.show()
    asking = QDialog(window)
    inside = QWidget()
    QVBoxLayout(asking).addWidget(inside)
    asking.open()
    above: list[object] = []

    def look(dialog: QFileDialog) -> None:
        above.append(dialog.parentWidget())
        dialog.reject()

    first = answer(look)
    file_dialogs.choose_folder(inside, "Store it in", str(tmp_path))
    assert above == [asking]
    asking.deleteLater()
    qtbot.wait(20)
    second = answer(look)
    file_dialogs.choose_folder(window, "Store it in", str(tmp_path))
    assert second[0] is first[0]
    assert above[1] is window


def test_another_window_has_a_dialog_of_its_own(qtbot: QtBot, tmp_path: Path) -> None:
    for _ in range(2):
        window = QMainWindow()
        window.show()
        answer(lambda dialog: dialog.reject())
        assert file_dialogs.choose_folder(window, "Store scans in", str(tmp_path)) == ""
        window.deleteLater()
        qtbot.wait(20)
