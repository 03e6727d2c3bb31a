"""Where to save something: a file of a person's choice, with an ending of its format."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QWidget

from dsl_app.shared.paths import there
from dsl_app.shared.widgets.dialogs import confirm

_ENDING = re.compile(r"\*(\.\w+)")


def ask_target(parent: QWidget, title: str, draft: str, kinds: str) -> tuple[Path, bool] | None:
    """The chosen file, and whether it may be replaced; None if nobody chose one.

    ``kinds`` are Qt's filters, such as ``"HTML page (*.html);;PDF (*.pdf)"``: a name without one of their
    endings gets that of the chosen kind.
    """
    name, kind = QFileDialog.getSaveFileName(parent, title, draft, kinds)
    return with_ending(name, kind or kinds, kinds) if name else None


def with_ending(name: str, kind: str, kinds: str) -> tuple[Path, bool]:
    """The file that a name stands for in a dialog that offers ``kinds``, and whether it may be replaced.

    A name keeps an ending of any of them, and gets that of its own ``kind`` otherwise, if that has one.
    """
    path, endings = Path(name), _ENDING.findall(kind)
    if not endings or path.suffix.lower() in _ENDING.findall(kinds):
        return path, True
    # The dialog asked about replacing the name as typed, not one with an ending added.
    return path.with_name(path.name + endings[0]), False


def ask_place(parent: QWidget, title: str, draft: str, kinds: str) -> Path | None:
    """As `ask_target`, of what is written over any file there: a person is asked about that file, too."""
    target = ask_target(parent, title, draft, kinds)
    if target is None:
        return None
    path, is_asked = target
    if is_asked or not there(path):
        return path
    text = f"{path.name} already exists. Do you want to replace it?"
    return path if confirm(parent, title, text, go="Replace", stay="Keep it") else None
