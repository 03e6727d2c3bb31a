"""Files that are there whole or not at all, also after a crash or a power cut."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
from itertools import chain, count
from pathlib import Path

from dsl_core.errors import StoreError
from dsl_core.io.objects.address import require_local

PARTIAL_SUFFIX = ".partial"
_QUOTA = getattr(errno, "EDQUOT", errno.ENOSPC)
_DISK_FULL = {errno.ENOSPC, _QUOTA}

#: NumPy's ``tofile``, which asks for room first, and Pillow's encoders, when the system gives or takes less.
_SHORT_WRITE = re.compile(r"\d+ requested and \d+ written|Not enough free space to write|encoder error -2")
#: Less than any file system needs for itself.
_LITTLE_BYTES = 1 << 16


def write_atomic(path: Path, data: bytes | bytearray | memoryview) -> None:
    """Write a file through a neighbour that is synced and renamed; raises `StoreError`.

    When anything goes wrong the file keeps its old content (or stays absent) and nothing is left behind.
    """
    partial = path.with_name(path.name + PARTIAL_SUFFIX)
    try:
        # A new file: what bears the name may be a link out of the folder.
        partial.unlink(missing_ok=True)
        descriptor = os.open(
            partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644
        )
        try:
            write_all(descriptor, data)
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        os.replace(partial, path)
        sync_folder(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):  # a drive that has become read-only does not even look for it
            partial.unlink(missing_ok=True)
        raise store_error(path, error) from error


def write_all(descriptor: int, data: bytes | bytearray | memoryview) -> None:
    """Write every byte to an open file; the system may take them in several pieces."""
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(descriptor, rest) :]


def make_safe(file: Path) -> None:
    """Have the content of a file survive a power cut."""
    # Opened for writing because Windows only flushes handles that may write.
    with file.open("rb+") as handle:
        os.fsync(handle.fileno())


def sync_folder(folder: Path) -> None:
    """Make renames and new names in a folder durable; Windows does so by itself."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def set_aside(path: Path) -> str:
    """Rename a file that cannot be read, so that a new one does not replace it; says where it is now.

    What was set aside earlier stays too. Returns an empty text where the file cannot be renamed.
    """
    numbers = chain([""], count(2))
    try:
        names = (path.with_suffix(f".damaged{number}{path.suffix}") for number in numbers)
        aside = next(name for name in names if not name.exists())
        os.replace(path, aside)
    except OSError:
        return ""
    return f" The old file is kept as {aside}."


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, to be there also after a power cut; raises `StoreError`."""
    require_local(folder)
    try:
        make_durable(folder)
    except OSError as error:
        if error.errno in _DISK_FULL:
            raise store_error(folder, error) from error
        if isinstance(error, NotADirectoryError | FileExistsError):
            raise StoreError(
                f"The folder {folder} cannot be created: a file is where a folder is needed."
                " Choose another place."
            ) from error
        raise StoreError(
            f"The folder {folder} cannot be created ({error.strerror}). Check its parent folder's"
            " permissions."
        ) from error


def make_durable(folder: Path) -> None:
    """Make a folder and those above it; a new name is only safe once the folder that it is in is synced."""
    new = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for each in reversed(new):
        sync_folder(each.parent)


def remove_partials(folder: Path) -> None:
    """Delete what an interrupted `write_atomic` left in a folder; raises `StoreError`."""
    try:
        for leftover in folder.glob("*" + PARTIAL_SUFFIX):
            leftover.unlink(missing_ok=True)
    except OSError as error:
        raise store_error(folder, error) from error


def store_error(path: Path, error: OSError) -> StoreError:
    """The sentence for a failed write."""
    if error.errno in _DISK_FULL or (
        error.errno is None and (_SHORT_WRITE.search(str(error)) or is_full(path))
    ):
        return _quota_used_up(path) if error.errno == _QUOTA != errno.ENOSPC else disk_full(path)
    reason = error.strerror or str(error)
    return StoreError(
        f"{path} could not be written ({reason}). Check the folder's permissions and its drive."
    )


def _quota_used_up(path: Path) -> StoreError:
    """The sentence for a disk that may have space, but none for this user."""
    return StoreError(
        f"Your quota is used up: {path} could not be written. Nothing saved before is lost; delete files of"
        " yours from this drive, or have the quota raised, and try again."
    )


def disk_full(path: Path) -> StoreError:
    """The sentence for a disk without space, or without room for one more file whatever its size."""
    if _lacks_names(path):
        return StoreError(
            f"The drive can hold no more files, although it has space: {path} could not be written. Nothing"
            " saved before is lost; delete files that you do not need, and try again."
        )
    return StoreError(
        f"The disk is full: {path} could not be written. Nothing saved before is lost;"
        " free some space and try again."
    )


def _lacks_names(path: Path) -> bool:
    """Whether the drive of a file has space, but no entry left in its table of files."""
    try:
        found = os.statvfs(path.parent)
    except (OSError, AttributeError):  # Windows has neither the call nor such a table
        return False
    return found.f_files > 0 and found.f_favail == 0 and found.f_bavail * found.f_frsize > _LITTLE_BYTES


def is_full(path: Path) -> bool:
    """Whether the disk of a file has no space; for writers that do not say why they fail."""
    try:
        return shutil.disk_usage(path.parent).free < _LITTLE_BYTES
    except OSError:
        return False
