"""What is said of a folder that is to be imported: its table, its target, its command. No Qt."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from dsl_app.importing.state import PUBLISHED, FileRow, Found, TakeInOrder

if TYPE_CHECKING:
    from dsl_core.io.published import FileRecord

SUFFIXES = {"scan": ".dsl", "calibration": ".json"}
KINDS = {"scan": "dataset", "calibration": "calibration"}


def rows_of(records: Iterable[FileRecord]) -> tuple[FileRow, ...]:
    """The table of files, with one line for files in a row that have the same fate."""

    def fate(record: FileRecord) -> tuple[str, str]:
        name = record.expected or record.found or ""
        folder = str(PurePosixPath(name).parent)
        # What lies in no folder is no series.
        return record.status, name if folder == "." else folder

    return tuple(_row(tuple(group)) for _, group in groupby(records, fate))


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
    """How much of a folder is as published."""
    from dsl_core.io.published.layout import as_published

    good, wanted = as_published(records)
    return f"A published {KINDS[kind]}: {good} of {wanted} entries are as published."


def target_for(folder: Path, kind: str, home: Path) -> Path:
    """A path for what is imported that is not taken."""
    target, count = home / f"{folder.name}{SUFFIXES[kind]}", 1
    while target.exists():
        count += 1
        target = home / f"{folder.name}-{count}{SUFFIXES[kind]}"
    return target


def trouble_of(found: Found, order: TakeInOrder) -> str:
    """Why nothing can be imported as it stands, and what to do; empty when it can."""
    if found.obstacle:
        return found.obstacle
    if not order.target.stem.strip() or order.target.name.startswith("."):
        return "Give it a name."
    if order.target.exists():
        return f"{order.target.name} exists already. Choose another name or folder."
    return ""


def command_of(found: Found, order: TakeInOrder) -> str:
    """The command that does the same."""
    words = ["dsl-scan import", _quoted(order.folder), "-o", _quoted(order.target)]
    if order.base != PUBLISHED:
        words.append(f"--calibration {_quoted(order.base)}")
    if found.kind == "calibration" and all(order.camera_px):
        words.append("--camera-size {}x{}".format(*order.camera_px))
    return " ".join(words)


def _quoted(text: object) -> str:
    return shlex.quote(str(text))
