"""What belongs to a result's folder: a file that is missing, cut off or changed is told.

Each chunk of an array ends with a checksum (zarr's codec ``crc32c``), which is compared when it is read. What
zarr has no checksum for is in two attributes of the folder, written last: ``inventory`` says which files
there are, how long each is and what CRC-32 its metadata have; ``attributes_crc32`` is that of all attributes.
A missing chunk is no error to zarr: it reads as the fill value.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from dsl_core.errors import StoreError
from dsl_core.io.patience import drive_error, says_nothing
from dsl_core.io.reading import read_bounded, require_plain
from dsl_core.model.base import Record

#: The attributes that are not of the result, but of its folder.
INVENTORY, CHECKSUM = "inventory", "attributes_crc32"
#: A digest of all that a folder was reconstructed from. Python may save altered results, which have none.
MADE_OF = "made_of"
METADATA_NAME = "zarr.json"


class Inventory(Record):
    """Bytes of each file by its path in the folder, and CRC-32 of those that hold metadata of arrays."""

    sizes: dict[str, int]
    crc32: dict[str, int]


def with_inventory(folder: Path, attributes: Mapping[str, Any]) -> dict[str, Any]:
    """The attributes of a folder, whose arrays are all written, with what it holds and their checksum."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and path != folder / METADATA_NAME]
    inventory = Inventory(
        sizes={_name(folder, path): path.stat().st_size for path in files},
        crc32={_name(folder, path): zlib.crc32(path.read_bytes()) for path in files if _is_metadata(path)},
    )
    own = {**attributes, INVENTORY: inventory.model_dump()}
    return {**own, CHECKSUM: _checksum(own)}


def check_inventory(folder: Path, attributes: Mapping[str, Any]) -> bool:
    """Compare a folder with its inventory; False where it has none, as results of earlier versions.

    Raises `StoreError` that names what differs, and for what is no plain file.
    """
    if INVENTORY not in attributes and CHECKSUM not in attributes:
        for path in folder.rglob("*"):
            if not path.is_dir():
                _size(folder, _name(folder, path))
        return False
    own = {key: value for key, value in attributes.items() if key != CHECKSUM}
    if attributes.get(CHECKSUM) != _checksum(own):
        raise _damaged(folder, f"the attributes in {METADATA_NAME} do not match their checksum")
    try:
        inventory = Inventory.model_validate(attributes.get(INVENTORY))
    except ValidationError as error:
        raise _damaged(folder, f"the inventory in {METADATA_NAME} cannot be read") from error
    for name, size in inventory.sizes.items():
        found = _size(folder, name)
        if found != size:
            raise _damaged(folder, f"its file {name} has {found} of {size} bytes")
    for path in folder.glob(f"*/{METADATA_NAME}"):
        if _name(folder, path) not in inventory.crc32:
            raise _damaged(folder, f"its file {_name(folder, path)} was added after it was written")
    for name, crc32 in inventory.crc32.items():
        try:
            content = read_bounded(folder / name)
        except OSError as error:
            raise _unread(folder, name, error) from error
        if zlib.crc32(content) != crc32:
            raise _damaged(folder, f"its file {name} does not match its checksum")
    return True


def _name(folder: Path, path: Path) -> str:
    return path.relative_to(folder).as_posix()


def _checksum(attributes: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(attributes, sort_keys=True).encode())


def _is_metadata(path: Path) -> bool:
    return path.name == METADATA_NAME


def _size(folder: Path, name: str) -> int:
    """Bytes of a file of the folder, which must be a plain one."""
    if name.startswith(("/", "\\")) or ":" in name or ".." in name.replace("\\", "/").split("/"):
        raise _damaged(folder, f"its inventory names {name!r}, which is not in the folder")
    try:
        return require_plain(folder / name)
    except OSError as error:
        raise _unread(folder, name, error) from error


def _unread(folder: Path, name: str, error: OSError) -> StoreError:
    if says_nothing(error):
        return drive_error(folder / name, error)
    return _damaged(folder, f"its file {name} cannot be read ({error.strerror or error})")


def _damaged(folder: Path, what: str) -> StoreError:
    return StoreError(
        f"The result {folder} is damaged: {what}. Restore it from a copy, or reconstruct it again from the"
        " scan's frames."
    )
