"""Finds a user's folders, and ``resources/`` in the source tree, an installed wheel and a frozen app."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Literal

from dsl_core.errors import StoreError

#: Names the folder of everything this program keeps for a user, instead of the system's usual place.
HOME_VARIABLE = "DSL_SCAN_HOME"


def own_folder(kind: Literal["data", "config", "cache"] = "data") -> Path:
    """Where this program keeps what is a user's: the folder in ``DSL_SCAN_HOME``, or the system's place.

    It is in ``~`` for a user without a home: nothing is found there, and writing it is refused.
    """
    import platformdirs

    if named := os.environ.get(HOME_VARIABLE):
        return Path(named)
    usual = {
        "data": platformdirs.user_data_path,
        "config": platformdirs.user_config_path,
        "cache": platformdirs.user_cache_path,
    }
    try:
        return usual[kind]("dsl-scan", appauthor=False)
    except RuntimeError:
        return Path("~") / "dsl-scan"


def expanded(path: Path) -> Path:
    """A path with the home folder that its ``~`` stands for, which stays where there is none."""
    try:
        return path.expanduser()
    except RuntimeError:
        return path


def resource_roots() -> tuple[Path, ...]:
    """Folders that may hold the resources, most specific first."""
    package = Path(__file__).resolve().parent
    frozen = getattr(sys, "_MEIPASS", None)  # set by PyInstaller's boot loader
    bundled = (Path(frozen) / "resources",) if frozen else ()
    return (*bundled, package / "_resources", package.parent / "resources")


def resource_path(name: str) -> Path:
    """Path of a file or folder of the resources, given as ``folder/file`` with forward slashes.

    Raises `StoreError` when the name leaves the resources or nothing of that name was installed.
    """
    if Path(name).is_absolute() or ".." in Path(name).parts:
        raise StoreError(f"Resource {name!r} is outside the resources; give a path relative to them.")
    for root in resource_roots():
        if (root / name).exists():
            return root / name
    raise StoreError(
        f"Resource {name!r} is not part of this installation (looked in "
        f"{', '.join(map(str, resource_roots()))}). Install dsl-scan again."
    )
