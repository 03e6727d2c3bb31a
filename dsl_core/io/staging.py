"""Lets any writer that wants a path write whole or not at all, and never over what is there."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from dsl_core.errors import StoreError
from dsl_core.io.atomic import PARTIAL_SUFFIX, store_error, sync_folder


@contextmanager
def staged(targets: Sequence[Path], *, overwrite: bool = False) -> Iterator[list[Path]]:
    """Yield a private path for each target (files or folders, all in one folder).

    When the block ends well, what it wrote is synced and renamed onto the targets; when it fails, the targets
    are as before and nothing is left behind. Raises `StoreError` when a target exists and may not be
    replaced, when the folder cannot be used, or when the disk fails.
    """
    check_targets(targets, overwrite=overwrite)
    home = targets[0].parent
    room = home / f".{targets[0].name}.{uuid.uuid4().hex[:8]}{PARTIAL_SUFFIX}"
    try:
        room.mkdir(parents=True)
        drafts = [room / target.name for target in targets]
        yield drafts
        for draft in drafts:
            _sync_tree(draft)
        for draft, target in zip(drafts, targets, strict=True):
            _move_in(draft, target, room)
        sync_folder(home)
    except OSError as error:
        raise store_error(targets[0], error) from error
    finally:
        shutil.rmtree(room, ignore_errors=True)


def check_targets(targets: Sequence[Path], *, overwrite: bool) -> None:
    """Raise `StoreError` when a target exists and may not be replaced; asked before long work too."""
    taken = [target for target in targets if target.exists()]
    if taken and not overwrite:
        names = ", ".join(str(target) for target in taken)
        raise StoreError(f"{names} exists already. Choose another name, or allow it to be replaced.")


def _sync_tree(path: Path) -> None:
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file()]
    for file in files:
        # Opened for writing because Windows only flushes handles that may write.
        with file.open("rb+") as handle:
            os.fsync(handle.fileno())
    if path.is_dir():
        for folder in [path, *(f for f in path.rglob("*") if f.is_dir())]:
            sync_folder(folder)


def _move_in(draft: Path, target: Path, room: Path) -> None:
    if not target.is_dir():
        os.replace(draft, target)
        return
    # A folder cannot be replaced in one step; the old one steps aside and returns if the new one fails.
    aside = room / (target.name + ".old")
    os.replace(target, aside)
    try:
        os.replace(draft, target)
    except OSError:
        os.replace(aside, target)
        raise
