"""The arrays of a result on disk as variables of xarray, which read them when they are used."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from xarray import Variable
from xarray.backends import BackendArray
from xarray.core import indexing

from dsl_core.errors import StoreError
from dsl_core.io.result.stored_arrays import StoredArray, stored_arrays


class _Checked(BackendArray):
    """An array whose damage is told in a sentence, whenever it is noticed."""

    def __init__(self, stored: StoredArray) -> None:
        self.shape: tuple[int, ...] = stored.shape
        self.dtype: np.dtype[Any] = stored.array.dtype
        self._stored = stored

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        support = indexing.IndexingSupport.OUTER
        return indexing.explicit_indexing_adapter(key, self.shape, support, self._stored.stored)


def stored_variables(path: Path, damaged: Callable[[Exception], StoreError]) -> dict[str, Variable]:
    """Every array of a folder by its name, packed as it is stored; see `stored_arrays`."""
    return {name: _variable(stored) for name, stored in stored_arrays(path, damaged).items()}


def _variable(stored: StoredArray) -> Variable:
    lazy = indexing.LazilyIndexedArray(_Checked(stored))
    kept = indexing.MemoryCachedArray(indexing.CopyOnWriteArray(lazy))  # type: ignore[no-untyped-call, arg-type]
    return Variable(stored.dims, kept, dict(stored.array.attrs))
