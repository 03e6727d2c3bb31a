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
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.kinds import what_is_at
from dsl_core.io.reading import read_json
from dsl_core.io.result.inventory import CHECKSUM, INVENTORY, check_inventory, with_inventory
from dsl_core.io.staging import FolderKind, staged
from dsl_core.model.result import SCHEMA_VERSION

if TYPE_CHECKING:
    import xarray as xr
    import zarr


_log = logging.getLogger(__name__)
#: Attributes on disk that are not the result's.
_OF_THE_FOLDER = ("labels", INVENTORY, CHECKSUM)


@dataclass(frozen=True)
class _Packing:
    """Stored integer = value / step; ``fill`` stands for NaN."""

    dtype: type[np.signedinteger[Any] | np.unsignedinteger[Any]]
    step: float
    lowest: int
    highest: int
    fill: int


_PACKINGS = {
    "reflectance": _Packing(np.int16, 5e-5, -32767, 32767, -32768),
    "reflectance_std": _Packing(np.uint16, 5e-5, 0, 65534, 65535),
    "data_share": _Packing(np.uint8, 1 / 250, 0, 254, 255),
}
# Number of bits that flags need; the model may hold them in any integer type.
_INTEGERS: dict[str, type[np.unsignedinteger[Any]]] = {"flags": np.uint16, "reach": np.uint8}


def save_result(result: xr.Dataset, path: Path, *, overwrite: bool = False) -> Path:
    """Store a result as a folder, whole or not at all, and return its path.

    Raises `StoreError` when the folder already exists (unless ``overwrite``, and it is a result too), the
    disk fails, or the dataset is not a result of this version.
    """
    _check_version(result.attrs.get("schema_version"), path)
    import zarr

    with staged([path], overwrite=overwrite, kind=RESULT_FOLDER) as (draft,):
        attributes = {key: _plain(value) for key, value in result.attrs.items()}
        labels = {str(n): c.values.tolist() for n, c in result.coords.items() if c.dtype.kind in "UO"}
        group = zarr.create_group(draft, zarr_format=3, attributes={**attributes, "labels": labels})
        for name, variable in result.variables.items():
            if str(name) not in labels:
                _write_variable(group, str(name), variable)
        group.update_attributes(with_inventory(draft, dict(group.attrs)))
        _consolidate(draft)
    return path


def _consolidate(folder: Path) -> None:
    """Repeat the arrays' metadata at the root, where other readers of zarr look for them first."""
    import zarr
    from zarr.errors import ZarrUserWarning

    with warnings.catch_warnings():
        # Not yet in the specification of version 3, but in use: zarr and xarray write and read it.
        warnings.simplefilter("ignore", ZarrUserWarning)
        zarr.consolidate_metadata(folder, zarr_format=3)


def load_result(path: Path, *, lazy: bool = True) -> xr.Dataset:
    """Open a saved result; bands are read when they are first used unless ``lazy`` is false.

    Raises `StoreError` when the folder is missing, damaged, not a result, or of another schema version.
    """
    import xarray as xr

    from dsl_core.io.result.stored_arrays import FAILURES, stored_variables

    stored = read_attributes(path)
    if not check_inventory(path, stored):
        _log.warning("%s was written without checksums: damage to it would not be noticed.", path)

    def damaged(error: Exception) -> StoreError:
        return StoreError(
            f"The result {path} is damaged ({error}). Reconstruct it again from the scan's frames."
        )

    variables = stored_variables(path, damaged)
    try:
        attributes = {key: value for key, value in stored.items() if key not in _OF_THE_FOLDER}
        labels = stored.get("labels", {})
        for variable in variables.values():
            # A scale factor read from JSON is a Python float, from which xarray would decode to float64.
            if "scale_factor" in variable.attrs:
                variable.attrs["scale_factor"] = np.float32(variable.attrs["scale_factor"])
        raw = xr.Dataset(variables, attrs=attributes)
        result = xr.decode_cf(raw).assign_coords({n: (n, np.array(v)) for n, v in labels.items()})
        return result if lazy else result.load()
    except FAILURES as error:
        raise damaged(error) from error


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
    """The attributes of a folder, after checking that it is a result that can be read."""
    if not (path / "zarr.json").is_file():
        raise StoreError(f"{path} is not a result: {what_is_at(path)}. Give the folder of one (NAME.zarr).")
    try:
        attributes: dict[str, Any] = read_json(path / "zarr.json")["attributes"]
        version, labels = attributes.get("schema_version"), attributes.get("labels", {})
        if not all(isinstance(names, list) for names in labels.values()):
            raise ValueError("the names along an axis must be a list")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StoreError(
            f"{path / 'zarr.json'} is damaged ({error}). Reconstruct the result again from the scan's frames."
        ) from error
    _check_version(version, path)
    return attributes


def _check_version(version: object, path: Path) -> None:
    if version == SCHEMA_VERSION:
        return
    if version is None:
        raise StoreError(f"{path}: a dataset without schema_version is not a result of this program.")
    raise StoreError(
        f"{path} is a result of schema version {version}; this program supports version {SCHEMA_VERSION}."
        " Use the version of the program that wrote it, or reconstruct the scan again."
    )


def _write_variable(group: zarr.Group, name: str, variable: xr.Variable) -> None:
    from zarr.codecs import BloscCodec, Crc32cCodec

    values, encoding = _encode(name, variable)
    plane = values.shape[-2:]
    one_band = (1,) * (values.ndim - len(plane)) + plane
    array = group.create_array(
        name,
        shape=values.shape,
        dtype=values.dtype,
        chunks=one_band,
        shards=values.shape if values.ndim > 2 else None,
        compressors=[BloscCodec(cname="zstd", clevel=1, shuffle="bitshuffle"), Crc32cCodec()],
        dimension_names=[str(d) for d in variable.dims],
        attributes={**{str(k): _plain(v) for k, v in variable.attrs.items()}, **encoding},
        # Looking for chunks that hold only the fill value costs more than writing them.
        config={"write_empty_chunks": True},
    )
    array[...] = values


def _encode(name: str, variable: xr.Variable) -> tuple[NDArray[Any], dict[str, float | int]]:
    """Stored array of a variable, and the CF attributes that undo the packing."""
    values: NDArray[Any] = np.asarray(variable.values)
    packing = _PACKINGS.get(name)
    if packing is not None and _fits(values, packing):
        return _pack(values, packing), {"scale_factor": packing.step, "_FillValue": packing.fill}
    if values.dtype.kind == "f" and variable.ndim > 1:
        return values.astype(np.float32, copy=False), {}
    return values.astype(_INTEGERS.get(name, values.dtype), copy=False), {}


def _fits(values: NDArray[Any], packing: _Packing) -> bool:
    lowest, highest = np.fmin.reduce(values, axis=None), np.fmax.reduce(values, axis=None)
    if np.isnan(lowest):  # nothing but NaN
        return True
    return bool(lowest >= packing.lowest * packing.step and highest <= packing.highest * packing.step)


def _pack(values: NDArray[Any], packing: _Packing) -> NDArray[Any]:
    packed: NDArray[Any] = np.empty(values.shape, packing.dtype)
    for band, out in zip(values, packed, strict=True):
        steps = np.rint(band / np.float32(packing.step))
        steps[np.isnan(band)] = packing.fill
        out[...] = steps
    return packed


def _plain(value: object) -> Any:
    """A value that JSON can hold."""
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value
