"""Whether files and folders are there, and paths as people type them. No Qt.

`Path.exists` and its like raise where a folder may not be entered or a name is too long. Here the answer is
no, and `barrier` says why.
"""

from __future__ import annotations

import os
from pathlib import Path

from dsl_core.io.reading import there as there
from dsl_core.resources import expanded as expanded

#: File systems take names of 255 bytes; while a file is written, its name has up to 18 more.
MOST_NAME_BYTES = 220


def is_file(path: Path) -> bool:
    """Whether a file with this path can be seen."""
    try:
        return path.is_file()
    except OSError:
        return False


def is_dir(path: Path) -> bool:
    """Whether a folder with this path can be seen."""
    try:
        return path.is_dir()
    except OSError:
        return False


def stamp_of(path: Path) -> tuple[int, int] | None:
    """When a file was changed last, ns, and its size, bytes; None while it cannot be seen."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def barrier(path: Path) -> str:
    """Why the system does not say what is there, such as *Permission denied*; empty if it does."""
    try:
        if path.is_dir():
            os.scandir(path).close()
            # A folder whose names can be listed need not be one that may be entered.
            (path / "entry").exists()
    except OSError as error:
        return error.strerror or str(error)
    return ""


def place_trouble(path: Path) -> str:
    """Why nothing can be created with this path, and what to do; empty where nothing is known against it."""
    first = path.parts[0] if path.parts else ""
    if first.startswith("~"):
        return f"{first} is not a home folder: this computer has no such user. Choose another folder."
    size = len(os.fsencode(path.name))
    if size > MOST_NAME_BYTES:
        return (
            f"The name is too long: it has {size} bytes, and {MOST_NAME_BYTES} are possible. A letter with an"
            " accent has two or more. Choose a shorter name."
        )
    if reason := barrier(path):
        return f"{path} cannot be accessed ({reason}). Choose another folder."
    return ""
