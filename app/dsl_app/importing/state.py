"""A folder of another program that is to be imported: what was found in it, and how to import it. No Qt."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Literal

from dsl_app.shared.evented import Event, Value
from dsl_app.shared.known_files import first_free
from dsl_app.shared.paths import place_trouble, there
from dsl_core.io.calibration_library import name_from
from dsl_core.words import quoted

if TYPE_CHECKING:
    from dsl_core.io.published.layout import FileRecord

#: Key of the published rig, whose film, sensor and scales are the default.
PUBLISHED = ""
SUFFIXES = {"scan": ".dsl", "calibration": ".json"}
KINDS = {"scan": "dataset", "calibration": "calibration"}


@dataclass(frozen=True)
class FileRow:
    """A line of the table: one file, or several in a row with the same status."""

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
    """What a folder contains; ``summary`` counts it, ``obstacle`` (if any) prevents its import.

    ``doubts`` (if any) say what of a calibration may not be meant like that.
    """

    folder: Path
    kind: Literal["scan", "calibration"]
    rows: tuple[FileRow, ...]
    summary: str
    obstacle: str = ""
    doubts: str = ""


@dataclass(frozen=True)
class ImportRequest:
    """How to import: ``base`` is `PUBLISHED`, a name of the library or the path of a file.

    ``camera_px`` is the image size of a calibration; 0 leaves it to the file. Its lengths are in units of
    ``unit_mm``.
    """

    folder: Path
    target: Path
    base: str = PUBLISHED
    camera_px: tuple[int, int] = (0, 0)
    unit_mm: float = 1.0


class ImportState:
    """Values that the controller sets and the dialog follows.

    ``busy`` says what is being checked (empty: nothing), ``trouble`` why the import cannot start (empty: it
    can). ``ready`` fires when a folder has been checked for the first time, ``done`` with what was imported.
    """

    def __init__(self) -> None:
        self.found: Value[Found | None] = Value(None)
        self.request: Value[ImportRequest | None] = Value(None)
        self.library: Value[tuple[str, ...]] = Value(())
        self.busy = Value("")
        self.trouble = Value("")
        self.ready: Event[Found] = Event()
        self.done: Event[Path] = Event()


def rows_of(records: Iterable[FileRecord]) -> tuple[FileRow, ...]:
    """The table of files, with one line for files in a row with the same status."""

    def group(record: FileRecord) -> tuple[str, str]:
        name = record.expected or record.found or ""
        folder = str(PurePosixPath(name).parent)
        # Files outside a folder are not a series.
        return record.status, name if folder == "." else folder

    return tuple(_row(tuple(rows)) for _, rows in groupby(records, group))


def _row(records: Sequence[FileRecord]) -> FileRow:
    first = records[0]
    advice = first.advice
    if len({record.advice for record in records}) > 1:
        advice += " (and so on)"
    return FileRow(
        _span([record.expected for record in records]),
        _span([record.found or "" for record in records]),
        first.status,
        advice,
        len(records),
    )


def _span(names: Sequence[str]) -> str:
    """The first and the last of several names.

    >>> _span(["a/0.png", "a/1.png", "a/2.png"])
    'a/0.png … 2.png (3)'
    """
    if not names[0] or len(names) == 1:
        return names[0]
    return f"{names[0]} … {PurePosixPath(names[-1]).name} ({len(names)})"


def summary_of(kind: str, records: Sequence[FileRecord]) -> str:
    """How much of a folder matches the published layout."""
    from dsl_core.io.published.layout import as_published

    good, expected = as_published(records)
    if not any(record.found for record in records):
        return f"Not a published {KINDS[kind]}: none of the {expected} entries it has was found."
    return f"A published {KINDS[kind]}: {good} of {expected} entries are as published."


def target_for(folder: Path, kind: str, home: Path) -> Path:
    """A path for what is imported that does not exist yet."""
    return first_free(home, folder.name, SUFFIXES[kind])


def trouble_of(found: Found, request: ImportRequest) -> str:
    """Why nothing can be imported, and what to do; empty when it can."""
    if found.obstacle:
        return found.obstacle
    if not request.target.stem.strip() or request.target.name.startswith("."):
        return "Enter a name."
    if there(request.target):
        return f"{request.target.name} already exists. Choose another name or folder."
    return place_trouble(request.target)


def command_of(found: Found, request: ImportRequest) -> str:
    """The command that does the same."""
    words = ["dsl-scan import", quoted(request.folder), "-o", quoted(request.target)]
    if request.base != PUBLISHED:
        words.append(f"--calibration {quoted(request.base)}")
    if found.kind == "calibration" and all(request.camera_px):
        words.append("--camera-size {}x{}".format(*request.camera_px))
    if found.kind == "calibration" and request.unit_mm != 1:
        words.append(f"--unit-mm {request.unit_mm:g}")
    return " ".join(words)


@dataclass(frozen=True)
class ImportView:
    """What the dialog says below its form: ``trouble`` prevents the import, ``remark`` says what it makes.

    Nothing on the form helps a folder that ``is_hopeless``: another one has to be chosen. Sizes and unit may
    help a calibration.
    """

    trouble: str
    remark: str
    is_busy: bool
    asks_lengths: bool
    is_hopeless: bool


def import_view(state: ImportState) -> ImportView:
    """The dialog's texts and rows for what is known now."""
    busy, request, found = state.busy.value, state.request.value, state.found.value
    is_calibration = found is not None and found.kind == "calibration"
    remark = "" if request is None else f"Creates {request.target.name}."
    if is_calibration:
        remark += " The calibration is also added to the library."
        name = "" if request is None else name_from(request.target.stem)
        if name in state.library.value:
            remark += f" That has one named {name} already, of which this becomes the current version."
    return ImportView(
        "" if busy else state.trouble.value,
        f"{busy}…" if busy else remark,
        bool(busy),
        is_calibration,
        not busy and found is not None and bool(found.obstacle) and not is_calibration,
    )
