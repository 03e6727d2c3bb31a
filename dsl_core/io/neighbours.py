"""Names of what is saved next to a scan or a result, and is called after it."""

from __future__ import annotations

from pathlib import Path

from dsl_core.errors import StoreError

SCAN_SUFFIX, RESULT_SUFFIX = ".dsl", ".zarr"


def named(folder: Path) -> Path:
    """The folder by a path that ends in its name, which ``.`` and ``..`` do not.

    Raises `StoreError` for the root of a drive, which has no name.
    """
    if folder.name not in ("", ".."):
        return folder
    whole = folder.resolve()
    if not whole.name:
        raise StoreError(f"{whole} is a whole drive, not a scan or result. Give the folder of one.")
    return whole


def stem_of(folder: Path, suffix: str = RESULT_SUFFIX) -> str:
    """The name of a folder without its suffix; any other dot in it is part of the name.

    >>> stem_of(Path("leaf 1.5.zarr")), stem_of(Path("leaf 1.5"))
    ('leaf 1.5', 'leaf 1.5')
    """
    name = named(folder).name
    return name.removesuffix(suffix) or name


def result_beside(scan: Path) -> Path:
    """Where the result of a scan is, unless another place was chosen.

    >>> result_beside(Path("leaf 1.5.dsl")).name, result_beside(Path("leaf 1.5")).name
    ('leaf 1.5.zarr', 'leaf 1.5.zarr')
    """
    return named(scan).with_name(f"{stem_of(scan, SCAN_SUFFIX)}{RESULT_SUFFIX}")


def beside_result(result: Path, ending: str) -> Path:
    """A file next to a result, called after it.

    >>> beside_result(Path("leaf 1.5.zarr"), ".marks.json").name
    'leaf 1.5.marks.json'
    """
    return named(result).with_name(f"{stem_of(result)}{ending}")
