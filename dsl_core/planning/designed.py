"""Designed pattern sets that come with the program, and files for others."""

from __future__ import annotations

import base64
import zlib
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.records import read_record, write_record
from dsl_core.model.base import Record
from dsl_core.model.plan import Columns
from dsl_core.resources import resource_path

FOLDER = "patterns"
#: Ten thousand frames of a projector 4096 wide.
MOST_LEVELS = 10_000 * 4096 * 3


class DesignedSet(Record):
    """Levels of a designed set, 8 bit (frames, width, 3), zlib-packed in base64, and how it was made.

    ``error`` and ``comb_error`` are what was expected of it and of the best comb of as many frames.
    """

    schema_version: Literal[1] = 1
    name: str
    rig: str
    command: str
    frames: int
    width_px: int
    lines: str
    comb_error: float
    error: float
    levels: str

    @property
    def array(self) -> NDArray[np.uint8]:
        """The levels, shape (frames, width, 3)."""
        wanted = self.frames * self.width_px * 3
        # Never unpacks more than is declared and a little, whatever a few bytes of a stranger expand to.
        raw = zlib.decompressobj().decompress(base64.b64decode(self.levels), min(wanted, MOST_LEVELS) + 1)
        return np.frombuffer(raw, np.uint8).reshape(self.frames, self.width_px, 3)


def packed(levels: NDArray[np.uint8]) -> str:
    """Levels as text."""
    return base64.b64encode(zlib.compress(np.ascontiguousarray(levels).tobytes(), 9)).decode("ascii")


def save_design(made: DesignedSet, path: Path, overwrite: bool = False) -> Path:
    """Write a set; raises `StoreError`."""
    return write_record(path, made, overwrite=overwrite)


def load_design(path: Path) -> DesignedSet:
    """Read a set; raises `StoreError`."""
    remedy = "'dsl-scan design' writes one."
    made = read_record(path, DesignedSet, remedy, called="The pattern set", fault="cannot be read")
    try:
        _ = made.array
    except (ValueError, OverflowError, zlib.error) as error:
        raise StoreError(f"The pattern set {path} cannot be read ({error}). {remedy}") from error
    return made


def designed_sets() -> dict[str, Columns]:
    """The sets of this installation as pattern sets, by name."""
    try:
        folder = resource_path(FOLDER)
    except StoreError:  # an installation without designed sets still has lines and combs
        return {}
    made = [load_design(path) for path in sorted(folder.glob("*.json"))]
    return {each.name: columns_of(each.array) for each in made}


def columns_of(levels: NDArray[np.uint8]) -> Columns:
    """Drive levels (frames, width, 3), 0 to 255, as a pattern set."""
    shares = np.round(levels / 255.0, 5)
    return Columns(levels=tuple(tuple(tuple(rgb) for rgb in frame) for frame in shares.tolist()))
