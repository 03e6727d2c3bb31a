"""What a person marked on a result: pins, regions and references, kept next to it as ``NAME.marks.json``."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from dsl_core.errors import StoreError
from dsl_core.io.neighbours import beside_result
from dsl_core.io.records import read_record, replace_record
from dsl_core.model.base import Record


class PinRecord(Record):
    """A pixel that was pinned."""

    name: str
    pixel: tuple[int, int]
    colour: int = 0
    shown: bool = True


class RegionRecord(Record):
    """A region: a closed outline of (x, y) corners, or runs of pixels where it was marked in 3D.

    Each run is (row, first column, columns).
    """

    name: str
    outline_px: tuple[tuple[float, float], ...] = ()
    runs: tuple[tuple[int, int, int], ...] = ()
    colour: int = 0
    shown: bool = True


class ReferenceRecord(Record):
    """A file with a spectrum to compare with; ``entry`` is its name there where the file holds several."""

    name: str
    file: str
    entry: str = ""
    colour: int = 0
    shown: bool = True


class Annotations(Record):
    """All marks of a result."""

    schema_version: Literal[1] = 1
    pins: tuple[PinRecord, ...] = ()
    regions: tuple[RegionRecord, ...] = ()
    references: tuple[ReferenceRecord, ...] = ()


def annotations_path(result: Path) -> Path:
    """Where the marks of a result are."""
    return beside_result(result, ".marks.json")


def save_annotations(annotations: Annotations, result: Path) -> Path:
    """Store the marks next to a result, whole or not at all; raises `StoreError`."""
    path = annotations_path(result)
    replace_record(path, annotations)
    return path


def load_annotations(result: Path) -> Annotations:
    """The marks next to a result, none where there is no file.

    Raises `StoreError` for a file that cannot be read now; whoever writes marks next must not replace it.
    """
    path = annotations_path(result)
    remedy = "Try again, restore it from a copy, or rename it to continue without its marks."
    try:
        return read_record(path, Annotations, remedy, called="The marks in", fault="cannot be read")
    except StoreError as error:
        if isinstance(error.__cause__, FileNotFoundError):
            return Annotations()
        raise
