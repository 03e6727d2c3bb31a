"""The calibrated rigs of this computer: named, dated, never overwritten.

``NAME/versions/STAMP.json``
    a calibrated rig with the accepted calibrations it was made of.
``NAME/current``
    the stamp of the version in use; every other one stays next to it.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from dsl_core.errors import DslError, StoreError
from dsl_core.io import CAMPAIGN_NAME
from dsl_core.io.atomic import write_atomic
from dsl_core.io.campaign_folder import RIG_NAME, now
from dsl_core.io.reading import read_bounded
from dsl_core.io.records import read_record, replace_record
from dsl_core.io.rig_file import load_rig
from dsl_core.model.base import Record
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.rig import Rig
from dsl_core.resources import own_folder

_NAME = re.compile(r"\w[\w .+-]*")


class LibraryEntry(Record):
    """One version of a calibrated rig; ``history`` holds what its calibrations replaced in the campaign."""

    schema_version: Literal[1] = 1
    name: str
    stored: str
    rig: Rig
    accepted: tuple[AcceptedCalibration, ...] = ()
    history: tuple[AcceptedCalibration, ...] = ()

    @property
    def stamp(self) -> str:
        """What tells the versions of a name apart: when it was stored, to the second or finer."""
        return stamp_of(self.stored)


@dataclass(frozen=True)
class LibraryLine:
    """A line of the library's list: ``error`` says why a version cannot be read, then ``entry`` is None."""

    name: str
    stamp: str
    is_current: bool
    entry: LibraryEntry | None = None
    error: str = ""


def stamp_of(time: str) -> str:
    """A time of ISO 8601 as part of a file's name.

    >>> stamp_of("2026-03-01T10:20:30.000400+00:00")
    '20260301-102030-000400'
    """
    return datetime.fromisoformat(time).astimezone(UTC).strftime("%Y%m%d-%H%M%S-%f")


def check_name(name: str) -> None:
    """Raise `StoreError` when nothing of the library can be called so; asked before long work too."""
    if not _NAME.fullmatch(name):
        raise StoreError(
            f"A calibration cannot be named {name!r}: use letters, digits, spaces and . + - _, beginning"
            " with a letter or digit."
        )


def name_from(text: str) -> str:
    """The name that is closest to a text, such as that of a file; empty where nothing of it can be used.

    >>> name_from("room 12 & 13")
    'room 12 - 13'
    """
    return re.sub(r"[^\w .+-]", "-", text).lstrip(" .+-")


def library_home(home: Path | None = None) -> Path:
    """The folder of the library: the one given, that of ``DSL_SCAN_HOME``, or the system's usual place."""
    return own_folder() / "calibrations" if home is None else home


class CalibrationLibrary:
    """Stores, lists and finds calibrated rigs."""

    def __init__(self, home: Path | None = None) -> None:
        """``home`` as for `library_home`; it is made when something is stored."""
        self.home = library_home(home)

    def store(
        self,
        name: str,
        rig: Rig,
        accepted: tuple[AcceptedCalibration, ...] = (),
        history: tuple[AcceptedCalibration, ...] = (),
    ) -> LibraryEntry:
        """Add a version of a name and make it the current one; raises `StoreError`."""
        check_name(name)
        entry = LibraryEntry(name=name, stored=now(), rig=rig, accepted=accepted, history=history)
        replace_record(self.home / name / "versions" / f"{entry.stamp}.json", entry)
        self._set_current(name, entry.stamp)
        return entry

    def names(self) -> tuple[str, ...]:
        """All names, sorted; one whose first version is still being written is not listed."""
        if not self.home.is_dir():
            return ()
        folders = self.home.glob("*/versions")
        return tuple(sorted(path.parent.name for path in folders if any(path.glob("*.json"))))

    def lines(self) -> tuple[LibraryLine, ...]:
        """Every version of every name, newest first within a name; damaged ones with the reason."""
        found = []
        for name in self.names():
            current = self._current(name)
            for stamp in reversed(self.stamps(name)):
                try:
                    entry, error = self._read(name, stamp), ""
                except DslError as failure:
                    entry, error = None, str(failure)
                found.append(LibraryLine(name, stamp, stamp == current, entry, error))
        return tuple(found)

    def stamps(self, name: str) -> tuple[str, ...]:
        """The versions of a name, oldest first."""
        return tuple(sorted(path.stem for path in (self.home / name / "versions").glob("*.json")))

    def find(self, name: str) -> LibraryEntry:
        """The current version of a name, or of ``NAME@STAMP`` the one whose stamp begins so.

        Raises `StoreError` when there is none, several, or it is damaged.
        """
        name, _, wanted = name.partition("@")
        if name not in self.names():
            known = ", ".join(self.names()) or "none"
            raise StoreError(f"The library has no calibration {name!r}; it has: {known}.")
        return self._read(name, self._one(name, wanted) if wanted else self._current(name))

    def restore(self, name: str, wanted: str) -> LibraryEntry:
        """Make another version of a name the current one; the one that was stays in the library.

        Raises `StoreError` when there is no such version or it is damaged; then nothing changes.
        """
        entry = self.find(f"{name}@{wanted}")
        self._set_current(name, entry.stamp)
        return entry

    def _one(self, name: str, wanted: str) -> str:
        found = [stamp for stamp in self.stamps(name) if stamp.startswith(wanted)]
        if len(found) != 1:
            known = ", ".join(self.stamps(name))
            how_many = "no version" if not found else f"{len(found)} versions"
            raise StoreError(f"{name!r} has {how_many} {wanted}...; its versions are {known}.")
        return found[0]

    def _read(self, name: str, stamp: str) -> LibraryEntry:
        return read_record(self.home / name / "versions" / f"{stamp}.json", LibraryEntry)

    def _current(self, name: str) -> str:
        """The stamp in use: the one noted, or the newest where the note is lost or points nowhere."""
        stamps = self.stamps(name)
        try:
            noted = read_bounded(self.home / name / "current").decode("ascii").strip()
        except (OSError, UnicodeDecodeError):
            noted = ""
        if noted in stamps:
            return noted
        if not stamps:
            raise StoreError(f"The calibration {name!r} in {self.home} has no version left. Save it again.")
        return stamps[-1]

    def _set_current(self, name: str, stamp: str) -> None:
        write_atomic(self.home / name / "current", f"{stamp}\n".encode())


def load_calibration(text: str, library: CalibrationLibrary | None = None) -> Rig:
    """The rig of a JSON file, a name of the library or a campaign; raises `CalibrationError` or `StoreError`.

    A file of the library, as `calibrations export` writes it, is taken as well. A name of the library
    counts before a folder of that name, which is usually the campaign it comes from.
    """
    path, shelf = Path(text), library or CalibrationLibrary()
    if path.is_dir() and text in shelf.names():
        return shelf.find(text).rig
    if (path / CAMPAIGN_NAME).is_file():
        path = path / RIG_NAME
    if path.is_file():
        entry = read_entry(path)
        return load_rig(path) if entry is None else entry.rig
    if path.exists():
        what = "a folder" if path.is_dir() else "a pipe or a device"
        raise StoreError(f"{text} is {what}. Give the path of a rig's JSON file, or a library's name.")
    if path.suffix.lower() == ".json" or os.sep in text:
        raise StoreError(f"There is no file {path}. Give the path of a rig's JSON file, or a library's name.")
    return shelf.find(text).rig


def read_entry(path: Path) -> LibraryEntry | None:
    """The entry in a file; None when the file holds something else, such as a rig alone."""
    try:
        return read_record(path, LibraryEntry)
    except StoreError:
        return None
