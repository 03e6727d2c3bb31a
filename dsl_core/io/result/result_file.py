"""A result on disk: a zarr v3 folder that xarray, or any zarr reader, opens on its own.

Cubes are chunked one band a chunk and kept in one file a variable, so that a band is read without its
neighbours and few files need syncing. The three large cubes are stored as integers with a CF
``scale_factor``: reflectance and its standard deviation in steps of 0.00005, the data share in steps
of 1/250. Half a step is far below the noise of a scan; a cube that does not fit the integer range is
stored as float32 instead. NaN is kept. Every chunk ends with a checksum, and an inventory says which
files belong to it: damage is told when it is read.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Mapping
from functools import partial
from json import JSONDecodeError
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dsl_core.errors import StoreError
from dsl_core.io.kinds import what_is_at
from dsl_core.io.patience import drive_error, is_away, is_refused, says_nothing
from dsl_core.io.reading import read_bounded, read_json
from dsl_core.io.result.arrays import plain, write_variable
from dsl_core.io.result.inventory import CHECKSUM, INVENTORY, MADE_OF, check_inventory, with_inventory
from dsl_core.io.staging import FolderKind, staged
from dsl_core.model.result import SCHEMA_VERSION
from dsl_core.model.result_order import canonical, with_bits

if TYPE_CHECKING:
    import xarray as xr


_log = logging.getLogger(__name__)
T = TypeVar("T")
#: So often a result is read again that was replaced while it was read.
_MOST_READINGS = 5
#: Attributes on disk that are not the result's.
_OF_THE_FOLDER = ("labels", INVENTORY, CHECKSUM, MADE_OF)


def save_result(result: xr.Dataset, path: Path, *, overwrite: bool = False) -> Path:
    """Store a result as a folder, whole or not at all, and return its path.

    Raises `StoreError` when the folder already exists (unless ``overwrite``, and it is a result too), the
    disk fails, or the dataset is not a result of this version.
    """
    _check_version(result.attrs.get("schema_version"), path)
    if not {"x", "y"} & set(result.dims):
        raise StoreError(
            f"{path}: the dataset has no pixels, as a single spectrum has none. Export it as a table (.csv)."
        )
    if empty := [str(axis) for axis, size in result.sizes.items() if not size]:
        raise StoreError(
            f"{path}: the dataset is empty along {' and '.join(empty)}. Keep at least one value of each axis."
        )
    import zarr

    # What no file can hold is told before anything is written.
    attributes = plain(result.attrs)
    result = with_bits(_with_labels(result))
    with staged([path], overwrite=overwrite, kind=RESULT_FOLDER) as (draft,):
        group = zarr.create_group(draft, zarr_format=3)
        labels = labels_of(result)
        for name, variable in result.variables.items():
            if str(name) not in labels:
                write_variable(group, str(name), variable)
        seal_folder(draft, {**own_attributes(attributes), "labels": labels})
    return path


def labels_of(result: xr.Dataset) -> dict[str, list[str]]:
    """The names along the axes that have some."""
    return {str(n): c.values.tolist() for n, c in result.coords.items() if c.dtype.kind in "UO"}


def _with_labels(result: xr.Dataset) -> xr.Dataset:
    """The result with the names along its axes, which another reader leaves among its attributes."""
    stored = result.attrs.get("labels", {})
    missing = {n: v for n, v in stored.items() if n not in result.coords and result.sizes.get(n) == len(v)}
    return result.assign_coords({n: (n, np.array(v)) for n, v in missing.items()})


def seal_folder(folder: Path, attributes: Mapping[Any, Any]) -> None:
    """Write attributes and inventory of a folder whose arrays are complete."""
    import zarr
    from zarr.errors import ZarrUserWarning

    group = zarr.open_group(folder, mode="r+", zarr_format=3, use_consolidated=False)
    group.attrs.put(plain(attributes))
    group.update_attributes(with_inventory(folder, dict(group.attrs)))
    with warnings.catch_warnings():
        # The arrays' metadata at the root, where other readers look for them first. Not yet in the
        # specification of version 3, but in use: zarr and xarray write and read it.
        warnings.simplefilter("ignore", ZarrUserWarning)
        zarr.consolidate_metadata(folder, zarr_format=3)


def load_result(path: Path, *, lazy: bool = True) -> xr.Dataset:
    """Open a saved result in the `canonical` order; bands are read when first used unless ``lazy`` is false.

    Raises `StoreError` when the folder is missing, damaged, not a result, or of another schema version.
    """
    return of_one_writing(path, lambda: opened(path, checked_attributes(path), lazy=lazy))


def of_one_writing(path: Path, read: Callable[[], T]) -> T:
    """What ``read`` makes of a result: again where another took its place meanwhile, as nothing else tells.

    The attributes of one result would be taken for those of the other's arrays. Raises what ``read`` raises,
    and `StoreError` for a result that does not keep still.
    """
    for _ in range(_MOST_READINGS):
        before = _writing_of(path)
        try:
            found = read()
        except StoreError:
            if _writing_of(path) in (before, None):
                raise
            continue
        if _writing_of(path) == before:
            return found
    raise StoreError(
        f"{path} was replaced {_MOST_READINGS} times while it was read. Wait until what writes it has ended,"
        " and open it then."
    )


def _writing_of(path: Path) -> tuple[int, ...] | None:
    """By what a folder's metadata, which are written last, are told from those of one that replaced it."""
    try:
        found = (path / "zarr.json").stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


def checked_attributes(path: Path) -> dict[str, Any]:
    """The attributes of a result whose files are all there, with those of its folder.

    Raises `StoreError` when the folder is missing, damaged, not a result, or of another schema version.
    """
    stored = read_attributes(path)
    if not check_inventory(path, stored):
        _log.warning("%s was written without checksums: damage to it would not be noticed.", path)
    return stored


def own_attributes(stored: Mapping[str, Any]) -> dict[str, Any]:
    """The attributes without those of the folder."""
    return {key: value for key, value in stored.items() if key not in _OF_THE_FOLDER}


def damage_of(path: Path, error: Exception) -> StoreError:
    """What is said of a result whose arrays cannot be read.

    Where its metadata cannot be read either, that is the drive's doing; else a single file is damaged.
    """
    if isinstance(error, OSError) and (is_refused(error) or (is_away(error) and _is_gone(path))):
        return drive_error(path, error)
    return StoreError(f"The result {path} is damaged ({error}). Reconstruct it again from the scan's frames.")


def _is_gone(path: Path) -> bool:
    """Whether the drive of a result does not answer."""
    try:
        read_bounded(path / "zarr.json")
    except OSError as error:
        return is_away(error)
    return False


def opened(path: Path, stored: Mapping[str, Any], *, lazy: bool = True) -> xr.Dataset:
    """A folder's arrays with its attributes, whether all belongs to it or not; raises `StoreError`."""
    import xarray as xr

    from dsl_core.io.result.stored_arrays import FAILURES
    from dsl_core.io.result.stored_variables import stored_variables

    variables = stored_variables(path, partial(damage_of, path))
    try:
        labels = stored.get("labels", {})
        for variable in variables.values():
            # A scale factor read from JSON is a Python float, from which xarray would decode to float64.
            if "scale_factor" in variable.attrs:
                variable.attrs["scale_factor"] = np.float32(variable.attrs["scale_factor"])
        raw = xr.Dataset(variables, attrs=own_attributes(stored))
        result = xr.decode_cf(raw).assign_coords({n: (n, np.array(v)) for n, v in labels.items()})
        result = canonical(result)
        return result if lazy else result.load()
    except FAILURES as error:
        raise damage_of(path, error) from error


def check_values(path: Path) -> None:
    """Read every value of a result, array by array; raises `StoreError` where a chunk is damaged."""
    from dsl_core.io.result.stored_arrays import stored_arrays

    for array in stored_arrays(path, partial(damage_of, path)).values():
        array.stored((slice(None),) * len(array.shape))


def has_checksums(path: Path) -> bool:
    """Whether damage to a result is noticed; False for those of earlier versions."""
    return INVENTORY in read_attributes(path)


def _node(path: Path) -> dict[str, Any]:
    """What zarr says of a folder; nothing where it is none of zarr's, or cannot be read."""
    try:
        content = read_json(path / "zarr.json")
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _is_result(folder: Path) -> bool:
    """Whether a folder is a result, of whatever version."""
    attributes = _node(folder).get("attributes")
    return isinstance(attributes, dict) and "schema_version" in attributes


def _is_of_result(entry: Path) -> bool:
    return entry.name == "zarr.json" or _node(entry).get("node_type") == "array"


#: What a result may replace.
RESULT_FOLDER = FolderKind("a result", _is_result, _is_of_result)


def read_attributes(path: Path) -> dict[str, Any]:
    """The attributes of a folder, after checking that it is a result that can be read.

    Raises `StoreError`.
    """
    if not (path / "zarr.json").is_file():
        raise StoreError(f"{path} is not a result: {what_is_at(path)}. Give the folder of one (NAME.zarr).")
    try:
        attributes: dict[str, Any] = read_json(path / "zarr.json")["attributes"]
        version, labels = attributes.get("schema_version"), attributes.get("labels", {})
        if not all(isinstance(names, list) for names in labels.values()):
            raise ValueError("the names along an axis must be a list")
    except JSONDecodeError as error:
        raise StoreError(
            f"{path / 'zarr.json'} is damaged: it is not JSON and may be cut off. Reconstruct the result"
            " again from the scan's frames."
        ) from error
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        if isinstance(error, OSError) and says_nothing(error):
            raise drive_error(path / "zarr.json", error) from error
        raise StoreError(
            f"{path / 'zarr.json'} is damaged ({error}). Reconstruct the result again from the scan's frames."
        ) from error
    _check_version(version, path)
    return attributes


def _check_version(version: object, path: Path) -> None:
    if version == SCHEMA_VERSION:
        return
    if version is None:
        raise StoreError(
            f"{path}: a dataset without schema_version is not a result of this program. If its arrays"
            f" are named like those of one, add the attribute schema_version with the value {SCHEMA_VERSION}."
        )
    raise StoreError(
        f"{path} is a result of schema version {version}; this program supports version {SCHEMA_VERSION}."
        " Use the version of the program that wrote it, or reconstruct the scan again."
    )
