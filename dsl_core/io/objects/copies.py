"""Folders brought here from an object store, and results published there: whole, or told to be incomplete."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dsl_core.errors import StoreError, TakenError
from dsl_core.io.atomic import make_folder, write_atomic
from dsl_core.io.objects.store import Found, ObjectFolder
from dsl_core.io.reading import read_json
from dsl_core.io.result.inventory import INVENTORY, METADATA_NAME
from dsl_core.progress import NoProgress, Progress

#: What was brought of a folder, next to it.
_TAGS = ".fetched.json"


def fetch(
    objects: ObjectFolder,
    folder: Path,
    progress: Progress | None = None,
    wanted: Callable[[str], bool] = lambda name: True,
) -> None:
    """Bring the objects of a folder here that are not here yet; raises `StoreError`.

    What an earlier run has brought is kept if the store still calls it by the same tag.
    """
    progress, known = progress or NoProgress(), objects.listed()
    if not known:
        raise StoreError(f"There is nothing at {objects.address}. Check the address.")
    tags_path = folder.with_name(f"{folder.name}{_TAGS}")
    make_folder(folder)
    tags = read_json(tags_path) if tags_path.is_file() else {}
    names = sorted(name for name in known if wanted(name))
    for i, name in enumerate(names):
        progress.report(f"fetch {folder.name}", i, len(names))
        path, found = _place(folder, name), known[name]
        if path.is_file() and path.stat().st_size == found.size and tags.get(name) == found.tag:
            continue
        content = objects.get(name)
        if content is None or len(content) != found.size:
            raise StoreError(f"{objects.address} changed while it was read. Give the same command again.")
        make_folder(path.parent)
        write_atomic(path, content)
        tags[name] = found.tag
        write_atomic(tags_path, json.dumps(tags).encode())


def publish(
    folder: Path, objects: ObjectFolder, *, overwrite: bool = False, progress: Progress | None = None
) -> None:
    """Write a result to the store; it is there once its metadata are, which come last.

    What a run that was stopped has left there is replaced. Raises `StoreError`, and `TakenError` where there
    is a result already (unless ``overwrite``); what is no part of a result is never replaced.
    """
    progress, there = progress or NoProgress(), require_free(objects, overwrite=overwrite)
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / METADATA_NAME)
    names = [path.relative_to(folder).as_posix() for path in files]
    if METADATA_NAME in there:
        objects.remove([METADATA_NAME])  # from now on, and until the end, what is there is no result
    for i, (path, name) in enumerate(zip(files, names, strict=True)):
        progress.report(f"write {folder.name}", i, len(files))
        objects.put(name, path.read_bytes())
    objects.remove(sorted(set(there) - {*names, METADATA_NAME}))
    objects.put(METADATA_NAME, (folder / METADATA_NAME).read_bytes())


def require_free(objects: ObjectFolder, *, overwrite: bool) -> dict[str, Found]:
    """What is at an address, where a result may be written; asked before long work too.

    Raises as `publish` does. What a run that was stopped has left is of a result, but lacks its metadata.
    """
    there = objects.listed()
    # Each array of a result is a folder with its metadata, and chunks in a folder "c".
    foreign = [
        name
        for name in sorted(there)
        if name != METADATA_NAME and not re.search(r"/(zarr\.json$|c(/|$))", name)
    ]
    if foreign:
        raise StoreError(f"{objects.address} contains {foreign[0]} and is not replaced. Choose another name.")
    if METADATA_NAME in there:
        # Arrays of other programs are called the same.
        if "schema_version" not in _attributes(objects.get(METADATA_NAME) or b""):
            raise StoreError(
                f"{objects.address} contains arrays that this program did not write, and is not replaced."
                " Choose another name."
            )
        if not overwrite:
            raise taken(objects)
    return there


def _attributes(metadata: bytes) -> dict[str, Any]:
    """The attributes of a folder; none where its metadata cannot be read."""
    try:
        return dict(json.loads(metadata)["attributes"])
    except (ValueError, KeyError, TypeError):
        return {}


def taken(objects: ObjectFolder) -> TakenError:
    """The error where something is at an address already."""
    return TakenError(f"{objects.address} already exists. Choose another name, or allow it to be replaced.")


def published_as(objects: ObjectFolder, attribute: str) -> str | None:
    """An attribute of the result at an address, if all objects of its inventory are there; None otherwise."""
    there = objects.listed()
    content = objects.get(METADATA_NAME) if METADATA_NAME in there else None
    if content is None:
        return None
    try:
        attributes = json.loads(content)["attributes"]
        sizes = attributes[INVENTORY]["sizes"]
        complete = all(name in there and there[name].size == size for name, size in sizes.items())
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
    return str(attributes.get(attribute)) if complete else None


def _place(folder: Path, name: str) -> Path:
    """Where an object belongs; raises `StoreError` for a name that leads out of the folder."""
    if name.startswith("/") or "\\" in name or ":" in name or ".." in name.split("/"):
        raise StoreError(
            f"The store contains an object {name!r}, which would be outside {folder}. Remove it."
        )
    return folder / name
