"""The arrays of a result on disk as variables: read when they are used, and checked when they are read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from xarray import Variable
from xarray.backends import BackendArray
from xarray.core import indexing

from dsl_core.errors import StoreError

#: What zarr, its codecs and the file system raise for damaged chunks.
FAILURES = (OSError, ValueError, KeyError, RuntimeError, TypeError, ArithmeticError)
#: An array may take this much memory, or that many times its file: few bytes that unpack to more are a trap.
MOST_BYTES = 1 << 30
MOST_RATIO = 200


class _Checked(BackendArray):
    """An array whose damage is told in a sentence, whenever it is noticed."""

    def __init__(self, array: zarr.Array[Any], damaged: Callable[[Exception], StoreError]) -> None:
        self.shape: tuple[int, ...] = array.shape
        self.dtype: np.dtype[Any] = array.dtype
        self._array, self._damaged = array, damaged

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key: tuple[Any, ...]) -> NDArray[Any]:
        try:
            values: NDArray[Any] = np.asarray(self._array.oindex[key])
        except FAILURES as error:
            raise self._damaged(error) from error
        return values


def stored_variables(path: Path, damaged: Callable[[Exception], StoreError]) -> dict[str, Variable]:
    """Every array of a folder by its name, packed as it is stored.

    ``damaged`` turns what zarr raises into the error that readers get, at once or when a chunk is read.
    """
    try:
        group = zarr.open_group(path, mode="r", zarr_format=3, use_consolidated=False)
        return {name: _variable(array, path / name, damaged) for name, array in group.arrays()}
    except FAILURES as error:
        raise damaged(error) from error


def _variable(array: zarr.Array[Any], folder: Path, damaged: Callable[[Exception], StoreError]) -> Variable:
    _require_honest(array, folder)
    lazy = indexing.LazilyIndexedArray(_Checked(array, damaged))
    dims = array.metadata.dimension_names or ()  # type: ignore[union-attr]
    if len(dims) != array.ndim or None in dims:
        raise ValueError(f"{folder.name} does not name its axes")
    kept = indexing.MemoryCachedArray(indexing.CopyOnWriteArray(lazy))  # type: ignore[no-untyped-call, arg-type]
    return Variable(dims, kept, dict(array.attrs))


def _require_honest(array: zarr.Array[Any], folder: Path) -> None:
    """Refuse an array that declares far more than its file can hold, before anything is allocated."""
    if array.nbytes <= MOST_BYTES:
        return
    there = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    if array.nbytes > MOST_RATIO * there:
        raise ValueError(
            f"{folder.name} declares {array.nbytes / 1e6:.0f} MB, which its {there} bytes cannot hold"
        )
