"""How the variables of a result are stored: packed, in chunks of one band with a checksum."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError

if TYPE_CHECKING:
    import xarray as xr
    import zarr


@dataclass(frozen=True)
class Packing:
    """Stored integer = value / step; ``fill`` stands for NaN."""

    dtype: type[np.signedinteger[Any] | np.unsignedinteger[Any]]
    step: float
    lowest: int
    highest: int
    fill: int


PACKINGS = {
    "reflectance": Packing(np.int16, 5e-5, -32767, 32767, -32768),
    "reflectance_std": Packing(np.uint16, 5e-5, 0, 65534, 65535),
    "data_share": Packing(np.uint8, 1 / 250, 0, 254, 255),
}
# Number of bits that flags need; the model may hold them in any integer type.
INTEGERS: dict[str, type[np.unsignedinteger[Any]]] = {"flags": np.uint16, "reach": np.uint8}


#: Chunks that hold only the fill value are written as well: a result that lacks a chunk is damaged, and a
#: search for them costs more. This is not a property of an array but of whoever opens it to write.
EMPTY_TOO = {"array.write_empty_chunks": True}


def write_variable(group: zarr.Group, name: str, variable: xr.Variable) -> None:
    """Store a whole variable as an array of a group."""
    values: NDArray[Any] = np.asarray(variable.values)
    packing = PACKINGS.get(name)
    kind, encoding = stored_as(name, variable, packing is not None and fits(values, packing))
    array = new_array(group, name, variable, values.shape, kind, encoding, values.shape[-2:])
    array[...] = encoded(values, kind, packing if encoding else None)


def new_array(
    group: zarr.Group,
    name: str,
    like: xr.Variable,
    shape: tuple[int, ...],
    kind: np.dtype[Any],
    encoding: dict[str, float | int],
    plane: tuple[int, ...],
) -> zarr.Array[Any]:
    """Room for a variable of a shape; dimensions and attributes are ``like`` those of a part of it.

    A chunk is a ``plane`` (rows, columns) of one band, a file those of all bands.
    """
    from zarr.codecs import BloscCodec, Crc32cCodec

    bands = shape[: len(shape) - len(plane)]
    return group.create_array(
        name,
        shape=shape,
        dtype=kind,
        chunks=(1,) * len(bands) + plane,
        shards=(*bands, *plane) if bands else None,
        compressors=[BloscCodec(cname="zstd", clevel=1, shuffle="bitshuffle"), Crc32cCodec()],
        dimension_names=[str(d) for d in like.dims],
        attributes={**plain(like.attrs), **encoding},
        config={"write_empty_chunks": True},
    )


def stored_as(
    name: str, variable: xr.Variable, fitting: bool
) -> tuple[np.dtype[Any], dict[str, float | int]]:
    """The type that a variable is stored in, and the CF attributes that undo its packing, if ``fitting``."""
    packing = PACKINGS.get(name)
    if packing is not None and fitting:
        return np.dtype(packing.dtype), {"scale_factor": packing.step, "_FillValue": packing.fill}
    if variable.dtype.kind == "f" and variable.ndim > 1:
        return np.dtype(np.float32), {}
    return np.dtype(INTEGERS.get(name, variable.dtype)), {}


def encoded(values: NDArray[Any], kind: np.dtype[Any], packing: Packing | None) -> NDArray[Any]:
    """Values as they are stored."""
    return values.astype(kind, copy=False) if packing is None else pack(values, packing)


def fits(values: NDArray[Any], packing: Packing) -> bool:
    """Whether values are in the range of a packing."""
    lowest, highest = np.fmin.reduce(values, axis=None), np.fmax.reduce(values, axis=None)
    if np.isnan(lowest):  # nothing but NaN
        return True
    return bool(lowest >= packing.lowest * packing.step and highest <= packing.highest * packing.step)


def pack(values: NDArray[Any], packing: Packing) -> NDArray[Any]:
    """Steps of the packing, band by band, so that little more than the result is in memory."""
    packed: NDArray[Any] = np.empty(values.shape, packing.dtype)
    for band, out in zip(values, packed, strict=True):
        steps = np.rint(band / np.float32(packing.step))
        steps[np.isnan(band)] = packing.fill
        out[...] = steps
    return packed


def plain(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    """Attributes as JSON can hold them; raises `StoreError` that names one that it cannot."""
    found = {
        str(name): value.tolist() if isinstance(value, np.generic | np.ndarray) else value
        for name, value in attributes.items()
    }
    for name, value in found.items():
        try:
            json.dumps(value)
        except (TypeError, ValueError) as error:
            raise StoreError(
                f"The attribute {name!r} of the result cannot be saved ({error}). Make it a text, such as"
                " str(value), or a number."
            ) from error
    return found
