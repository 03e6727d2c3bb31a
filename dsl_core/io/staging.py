"""Files and folders that are written whole or not at all, and never replace anything by accident."""

from __future__ import annotations

import contextlib
import logging
import os
import re
import shutil
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from dsl_core.errors import StoreError, TakenError
from dsl_core.io import CAMPAIGN_NAME, MANIFEST_NAME
from dsl_core.io.atomic import PARTIAL_SUFFIX, make_durable, make_safe, store_error, sync_folder
from dsl_core.io.kinds import whose_inside
from dsl_core.io.objects.address import require_local
from dsl_core.io.scan.lock import FolderLock
from dsl_core.io.swap import exchange

_log = logging.getLogger(__name__)
_LOCK_NAME, _OLD_SUFFIX = "writer.lock", ".old"
#: How the private folder of a writer is called.
_ROOM = re.compile(rf"\..+\.[0-9a-f]{{8}}{re.escape(PARTIAL_SUFFIX)}")
_DAY_S = 86_400.0


@contextmanager
def staged(
    targets: Sequence[Path], *, overwrite: bool = False, kind: FolderKind | None = None
) -> Iterator[list[Path]]:
    """Yield a private path for each target (all in one folder): files, or folders of a ``kind``.

    When the block ends well, what it wrote is synced and renamed onto the targets; when it fails, the targets
    are as before and nothing is left behind. Raises `StoreError` when a target exists and may not be
    replaced, when the folder cannot be used, or when the disk fails.
    """
    with _room_for(targets, overwrite, kind) as room:
        drafts = [room / target.name for target in targets]
        yield drafts
        for draft in drafts:
            _sync_tree(draft)
        # What is there now may have come while the block was writing.
        check_targets(targets, overwrite=overwrite, kind=kind)
        for draft, target in zip(drafts, targets, strict=True):
            _move_in(draft, target, room)
        sync_folder(targets[0].parent)


def put_in_place(folder: Path, target: Path, *, overwrite: bool, kind: FolderKind) -> None:
    """Sync a finished folder and move it to its target on the same drive, which is whole or as before.

    Whatever fails, the work of hours is still there: the folder stays where it is. Raises as `staged` does.
    """
    with _room_for([target], overwrite, kind) as room:
        _sync_tree(folder)
        check_targets([target], overwrite=overwrite, kind=kind)
        if not os.path.lexists(target):
            # In one step: whoever is killed between two has neither the result nor what it was made of.
            _move_in(folder, target, room)
        else:
            # By way of the room, which is where an old one may be left.
            draft = room / target.name
            os.replace(folder, draft)
            try:
                _move_in(draft, target, room)
            except OSError:
                os.replace(draft, folder)
                raise
        sync_folder(target.parent)


@contextmanager
def _room_for(targets: Sequence[Path], overwrite: bool, kind: FolderKind | None) -> Iterator[Path]:
    """A private folder next to targets that are free, cleared at the end."""
    home = targets[0].parent
    clear_leftovers(home)
    check_targets(targets, overwrite=overwrite, kind=kind)
    room = home / f".{targets[0].name}.{uuid.uuid4().hex[:8]}{PARTIAL_SUFFIX}"
    lock: FolderLock | None = None
    try:
        make_durable(home)
        lock = _furnished(room)
        yield room
    except OSError as error:
        raise store_error(targets[0], error) from error
    finally:
        if lock is not None:
            lock.release()
        _clear(room, targets)


def _furnished(room: Path) -> FolderLock:
    """Make the private folder of a writer, and take its lock."""
    room.mkdir()
    try:
        return FolderLock(room / _LOCK_NAME)
    except StoreError:
        if room.is_dir():
            raise
    # Another writer took the folder, empty as it was, for left over.
    room.mkdir()
    return FolderLock(room / _LOCK_NAME)


def clear_leftovers(home: Path) -> None:
    """Remove what writers that were killed left in a folder; what they had moved aside returns to its place.

    A writer holds a lock while it lives. One of an earlier version holds none: its room is left for a day,
    unless it is empty.
    """
    for room in home.glob(f".*{PARTIAL_SUFFIX}"):
        if not _ROOM.fullmatch(room.name) or not room.is_dir():
            continue
        with contextlib.suppress(OSError):
            room.rmdir()  # if it is empty: its writer was killed before it had a lock
        if not room.is_dir() or _is_in_use(room):
            continue
        _log.warning("%s was left by a writer that was killed, and is removed.", room)
        olds = room.glob(f"*{_OLD_SUFFIX}")
        with contextlib.suppress(StoreError):
            _clear(room, [home / old.name.removesuffix(_OLD_SUFFIX) for old in olds])


def _is_in_use(room: Path) -> bool:
    try:
        if not (room / _LOCK_NAME).is_file():
            return time.time() - room.stat().st_mtime < _DAY_S
        FolderLock(room / _LOCK_NAME).release()
    except (OSError, StoreError):
        return True
    return False


def write_text(path: Path, text: str | Callable[[], str], *, overwrite: bool = False) -> Path:
    """Write a text file in UTF-8, whole or not at all, and return its path; raises `StoreError`.

    Text that takes long to make is given as a function, which is called once the path is known to be free.
    """
    with staged([path], overwrite=overwrite) as (draft,):
        draft.write_bytes((text if isinstance(text, str) else text()).encode(errors="replace"))
    return path


def check_targets(targets: Sequence[Path], *, overwrite: bool, kind: FolderKind | None = None) -> None:
    """Raise `StoreError` when a target exists and may not be replaced; asked before long work too.

    A file may replace a file, a folder only one of its own ``kind`` with nothing else in it. Nor may what
    would hold the target be a file, closed to this user, a scan or result itself, or an object store.
    """
    for target in targets:
        require_local(target)
        _require_room(target)
    # A link to nothing is there, although nothing exists behind it.
    taken = [target for target in targets if os.path.lexists(target)]
    for target in taken:
        _require_form(target, kind)
    if taken and not overwrite:
        names = ", ".join(str(target) for target in taken)
        raise TakenError(f"{names} already exists. Choose another name, or allow it to be replaced.")
    for target in taken:
        if kind is not None and (why := kind.refusal(target)):
            raise StoreError(
                f"{target} {why} and is not replaced: only {kind.name} may be replaced by another."
                " Choose another name."
            )
    for target in targets:
        if whose := whose_inside(target):
            raise StoreError(f"{target} would be inside {whose}. Choose another place.")


def _require_room(target: Path) -> None:
    """Raise `StoreError` when the nearest folder above that exists cannot take a new entry."""
    if target.name in ("", ".."):
        raise StoreError(f"{str(target)!r} names no file to write. Give a name.")
    above = next(folder for folder in target.absolute().parents if folder.exists())
    if not above.is_dir():
        raise StoreError(
            f"{target} cannot be written: {above} is a file, not a folder. Choose another place."
        )
    if not os.access(above, os.W_OK | os.X_OK):
        raise StoreError(
            f"{target} cannot be written: the folder {above} is closed to you. Choose another place, or"
            " change its permissions."
        )


def _require_form(target: Path, kind: FolderKind | None) -> None:
    """Raise `StoreError` when there is a folder where a file is needed, or the reverse."""
    if target.is_dir() and kind is None:
        raise StoreError(f"{target} is a folder, but a file is to be written. Choose another name.")
    if not target.is_dir() and kind is not None:
        raise StoreError(f"{target} is a file, but {kind.name} is a folder. Choose another name.")


def _sync_tree(path: Path) -> None:
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file()]
    for file in files:
        make_safe(file)
    if path.is_dir():
        for folder in [path, *(f for f in path.rglob("*") if f.is_dir())]:
            sync_folder(folder)


def _move_in(draft: Path, target: Path, room: Path) -> None:
    if target.is_dir():
        if exchange(draft, target):
            return
        # Two steps where it cannot be one: the old one steps aside, and `_clear` says what becomes of it.
        os.replace(target, _aside(target, room))
    os.replace(draft, target)


def _clear(room: Path, targets: Sequence[Path]) -> None:
    """Delete what is left over, after an old folder without a successor has been moved back to its place.

    Raises `StoreError` that says where the old folder is when it cannot be moved back; then it stays there.
    """
    for target in targets:
        aside = _aside(target, room)
        if aside.exists() and not target.exists():
            try:
                os.replace(aside, target)
            except OSError as error:
                raise StoreError(
                    f"{target} could not be replaced ({error.strerror or error})."
                    f" The old one is kept as {aside}; move it back."
                ) from error
    _remove(room)


def _remove(room: Path) -> None:
    """Delete a room with its lock last, by which what a kill or a drive keeps of it is known as left over."""
    with contextlib.suppress(OSError):
        for path in room.iterdir():
            if path.name == _LOCK_NAME:
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink()
        if [path.name for path in room.iterdir()] in ([], [_LOCK_NAME]):
            shutil.rmtree(room, ignore_errors=True)


def _aside(target: Path, room: Path) -> Path:
    return room / (target.name + _OLD_SUFFIX)


#: What is nowhere else, by the file that tells it.
_IRREPLACEABLE = {MANIFEST_NAME: "contains a scan", CAMPAIGN_NAME: "contains the captures of a campaign"}
#: Files that systems put into folders that a person looks at.
_OF_THE_SYSTEM = {".DS_Store", "Thumbs.db", "desktop.ini"}


@dataclass(frozen=True)
class FolderKind:
    """A kind of folder: how to call one, how it is recognised, and which entries of it are its own."""

    name: str
    is_one: Callable[[Path], bool]
    owns: Callable[[Path], bool]

    def refusal(self, folder: Path) -> str:
        """Why another of this kind must not replace a folder; empty when nothing else would be lost."""
        for file, what in _IRREPLACEABLE.items():
            if (folder / file).exists():
                return what
        entries = [entry for entry in folder.iterdir() if entry.name not in _OF_THE_SYSTEM]
        if entries and not self.is_one(folder):
            return f"is not {self.name}"
        foreign = sorted(entry.name for entry in entries if not self.owns(entry))
        return f"contains {foreign[0]} next to {self.name}" if foreign else ""
