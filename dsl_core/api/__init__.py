"""What scripts use: functions over paths and plain values, and the accessor of results."""

import os
from pathlib import Path

from dsl_core.errors import StoreError

#: What names a file or folder.
FilePath = str | os.PathLike[str]


def path_text(given: FilePath) -> str:
    """What names a file or folder as text; raises `StoreError` for anything else."""
    if not isinstance(given, str | os.PathLike):
        raise StoreError(
            "A path is needed, as text or as pathlib makes it; what was given is of type"
            f" {type(given).__name__}."
        )
    return os.fspath(given)


def path_of(given: FilePath) -> Path:
    """What names a file or folder; raises `StoreError` for anything else."""
    return Path(path_text(given))
