"""A folder that nobody may enter or list, also where tests run with all rights."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


def lock(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    """Let the system refuse whatever is in a folder, and to list it; the folder itself is seen."""

    def guarded(real: Callable[..., Any], is_barred: Callable[[Path], bool]) -> Callable[..., Any]:
        def call(path: Any = ".", *rest: Any, **options: Any) -> Any:
            if isinstance(path, str | Path) and is_barred(Path(path)):
                raise PermissionError(errno.EACCES, "Permission denied", str(path))
            return real(path, *rest, **options)

        return call

    def is_inside(path: Path) -> bool:
        return folder in path.parents

    monkeypatch.setattr(os, "stat", guarded(os.stat, is_inside))
    for name in ("scandir", "listdir"):
        real = getattr(os, name)
        monkeypatch.setattr(os, name, guarded(real, lambda path: path == folder or is_inside(path)))
