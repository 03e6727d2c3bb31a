"""Where to save something: a file of a person's choice, with an ending of its format."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QWidget

_ENDING = re.compile(r"\*(\.\w+)")


def ask_target(parent: QWidget, title: str, draft: str, kinds: str) -> tuple[Path, bool] | None:
    """The chosen file, and whether it may be replaced; None if nobody chose one.

    ``kinds`` are Qt's filters, such as ``"HTML page (*.html);;PDF (*.pdf)"``: a name without one of their
    endings gets that of the chosen kind.
    """
    name, kind = QFileDialog.getSaveFileName(parent, title, draft, kinds)
    if not name:
        return None
    path = Path(name)
    if path.suffix.lower() in _ENDING.findall(kinds):
        return path, True
    ending = _ENDING.findall(kind or kinds)[0]
    # The dialog asked about replacing the name as typed, not one with an ending added.
    return path.with_name(path.name + ending), False
