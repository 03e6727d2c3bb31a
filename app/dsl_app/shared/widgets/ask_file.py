"""Dialogs that ask for a file or folder to read; they begin where the last one ended.

The first begins among the person's documents: Qt begins it wherever the program was started from.
"""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QStandardPaths
from PySide6.QtWidgets import QFileDialog, QWidget

from dsl_app.shared.paths import expanded, is_dir

_last: list[Path] = []


def start_folder() -> str:
    """Where the last choice was made, while that folder is there; else the documents, else the home."""
    documents = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.DocumentsLocation)
    places = [*_last, *([Path(documents)] if documents else [])]
    return str(next((place for place in places if is_dir(place)), expanded(Path("~"))))


def chosen_in(path: Path) -> None:
    """Begin the next dialog where this file or folder is."""
    _last[:] = [path.parent]


def ask_file(parent: QWidget, title: str, kinds: str, folder: str = "") -> Path | None:
    """A file that a person chooses, None for nothing; ``kinds`` are Qt's filters."""
    name, _ = QFileDialog.getOpenFileName(parent, title, folder or start_folder(), kinds)
    return _kept(name)


def ask_folder(parent: QWidget, title: str, folder: str = "") -> Path | None:
    """A folder that a person chooses, None for nothing."""
    return _kept(QFileDialog.getExistingDirectory(parent, title, folder or start_folder()))


def _kept(name: str) -> Path | None:
    if not name:
        return None
    chosen_in(Path(name))
    return Path(name)
