"""Folders of this computer for what is worked on and belongs in an object store."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dsl_core.extras import require_package
from dsl_core.io.claims import Claim
from dsl_core.io.objects.address import Address, address_of
from dsl_core.io.objects.copies import fetch, publish, require_free
from dsl_core.io.objects.store import ObjectFolder
from dsl_core.progress import Progress
from dsl_core.resources import own_folder

#: How names of a scan's frames begin.
_FRAMES = "frames/c."


def room_of(address: Address) -> Path:
    """Where a folder of a store is kept here until it is no longer needed."""
    digest = hashlib.sha256(str(address).encode()).hexdigest()[:16]
    return own_folder("cache") / "objects" / digest / Path(address.name).name


@contextmanager
def brought(path: Path, progress: Progress | None = None, *, frames: bool = True) -> Iterator[Path]:
    """A folder with what is at a path: the path itself, or a copy of what is at its address.

    Without ``frames`` it is what tells of a scan; `bring_frames` brings these. The copy is removed when the
    block ends well; one that was interrupted is completed the next time. Raises `StoreError`, and
    `MissingPackageError` without the extra.
    """
    address = address_of(path)
    if address is None:
        yield path
        return
    require_package("obstore")
    room = room_of(address)
    with Claim(room):
        fetch(ObjectFolder(address), room, progress, lambda name: frames or not name.startswith(_FRAMES))
        yield room
        shutil.rmtree(room.parent, ignore_errors=True)


def bring_frames(path: Path, folder: Path, progress: Progress | None = None) -> None:
    """Complete the folder that `brought` lends for a path, in its block; raises `StoreError`."""
    address = address_of(path)
    if address is not None:
        fetch(ObjectFolder(address), folder, progress)


@contextmanager
def published(path: Path, *, overwrite: bool = False, progress: Progress | None = None) -> Iterator[Path]:
    """A path for a result that is in its place when the block ends well, also where that is in a store.

    A result that could not be published is kept here, and published by the next block for the same path.
    """
    address = address_of(path)
    if address is None:
        yield path
        return
    require_package("obstore")
    objects, room = ObjectFolder(address), room_of(address)
    require_free(objects, overwrite=overwrite)
    with Claim(room):
        yield room
        publish(room, objects, overwrite=overwrite, progress=progress)
        shutil.rmtree(room.parent, ignore_errors=True)
