"""Finds a file of ``resources/`` in the source tree, in an installed wheel and in a frozen app."""

from __future__ import annotations

import sys
from pathlib import Path

from dsl_core.errors import StoreError


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
