"""A folder of another program that is to be imported: what was found in it, and what becomes of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dsl_app.shared.evented import Event, Value

#: Key of the published rig, whose film, sensor and scales are taken where nothing else is said.
PUBLISHED = ""


@dataclass(frozen=True)
class FileRow:
    """A line of the table: one file, or several in a row that have the same fate."""

    expected: str
    found: str
    status: str
    advice: str
    count: int = 1

    @property
    def is_odd(self) -> bool:
        """Whether there is something to do."""
        return self.status != "ok"


@dataclass(frozen=True)
class Found:
    """What a folder holds; ``summary`` counts it, ``obstacle`` (if any) keeps it from being imported."""

    folder: Path
    kind: Literal["scan", "calibration"]
    rows: tuple[FileRow, ...]
    summary: str
    obstacle: str = ""


@dataclass(frozen=True)
class TakeInOrder:
    """How to import: ``base`` is `PUBLISHED`, a name of the library or the path of a file.

    ``camera_px`` is the image size of a calibration; 0 leaves it to the file.
    """

    folder: Path
    target: Path
    base: str = PUBLISHED
    camera_px: tuple[int, int] = (0, 0)


class TakeInState:
    """Values that the controller sets and the dialog follows.

    ``busy`` says what is looked at (empty: nothing), ``trouble`` why nothing can be imported (empty: it can).
    ``ready`` fires when a folder was looked at for the first time, ``done`` with what was imported.
    """

    def __init__(self) -> None:
        self.found: Value[Found | None] = Value(None)
        self.order: Value[TakeInOrder | None] = Value(None)
        self.library: Value[tuple[str, ...]] = Value(())
        self.busy = Value("")
        self.trouble = Value("")
        self.ready: Event[Found] = Event()
        self.done: Event[Path] = Event()
