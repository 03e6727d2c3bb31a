"""Asks for files and folders, by one dialog: each that Qt makes takes a while and never gives all back."""

from __future__ import annotations

from PySide6.QtWidgets import QFileDialog, QLineEdit, QWidget
from shiboken6 import isValid

_Mode, _Accept, _Option = QFileDialog.FileMode, QFileDialog.AcceptMode, QFileDialog.Option
_made: list[QFileDialog] = []


def choose_folder(asker: QWidget, title: str, folder: str = "") -> str:
    """Ask for a folder that exists, beginning at one; empty when nothing was chosen."""
    dialog = _dialog(asker, title, _Mode.Directory, _Accept.AcceptOpen)
    dialog.setDirectory(folder)
    return _asked(dialog, asker)[0]


def open_file(asker: QWidget, title: str, folder: str = "", formats: str = "") -> tuple[str, str]:
    """Ask for a file that exists; returns it and the format that was chosen, both empty for nothing.

    ``formats`` are as Qt writes them, such as ``Plans (*.json);;All files (*)``.
    """
    dialog = _dialog(asker, title, _Mode.ExistingFile, _Accept.AcceptOpen, formats)
    dialog.setDirectory(folder)
    return _asked(dialog, asker)


def save_file(asker: QWidget, title: str, draft: str = "", formats: str = "") -> tuple[str, str]:
    """Ask for a file to write, proposing a path; as `open_file`. Asks before one that exists is taken."""
    dialog = _dialog(asker, title, _Mode.AnyFile, _Accept.AcceptSave, formats)
    dialog.selectFile(draft)
    return _asked(dialog, asker)


def _dialog(
    asker: QWidget, title: str, mode: QFileDialog.FileMode, accept: QFileDialog.AcceptMode, formats: str = ""
) -> QFileDialog:
    """The dialog, with nothing left of the last question, before the window that asks."""
    if not _made or not isValid(_made[0]):
        _made[:] = [QFileDialog(asker.window())]
    dialog = _made[0]
    _place(dialog, asker.window())
    dialog.setWindowTitle(title)
    dialog.setAcceptMode(accept)
    dialog.setFileMode(mode)
    dialog.setOption(_Option.ShowDirsOnly, mode is _Mode.Directory)
    dialog.setNameFilters(formats.split(";;") if formats else ["All files (*)"])
    for line in dialog.findChildren(QLineEdit):
        line.clear()
    return dialog


def _asked(dialog: QFileDialog, asker: QWidget) -> tuple[str, str]:
    chosen = ("", "")
    if dialog.exec():
        chosen = dialog.selectedFiles()[0], dialog.selectedNameFilter()
    # A window that asks may soon be gone, and would take the dialog along.
    home = asker.window()
    while (above := home.parentWidget()) is not None:
        home = above.window()
    _place(dialog, home)
    return chosen


def _place(dialog: QFileDialog, window: QWidget) -> None:
    if dialog.parentWidget() is not window:
        dialog.setParent(window, dialog.windowFlags())
