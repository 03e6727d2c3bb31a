"""The arrays of a result on disk: read part by part, unpacked, and checked when they are read.

It needs no xarray, which takes longer to import than a result takes to be read. What is read later than the
folder was opened must still be there: zarr reads a missing file as the fill value, without a word.
"""

from __future__ import annotations

import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.patience import drive_error, is_away

#: What zarr, its codecs and the file system raise for damaged chunks.
FAILURES = (OSError, ValueError, KeyError, RuntimeError, TypeError, ArithmeticError)
#: An array may take this much memory, or that many times its file: few bytes that unpack to more are a trap.
MOST_BYTES = 1 << 30
MOST_RATIO = 200
#: Conventions of CF that say how values were packed.
_FILLS, _SCALE, _OFFSET = ("_FillValue", "missing_value"), "scale_factor", "add_offset"
#: The files of an array: path, bytes and the time of the last change in ns.
_Files = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True)
class StoredArray:
    """An array of a folder with the names of its axes; ``damaged`` makes the error that readers get.

    ``files`` are those that it had when it was opened.
    """

    dims: tuple[str, ...]
    array: zarr.Array[Any]
    folder: Path
    files: _Files
    damaged: Callable[[Exception], StoreError]

    @property
    def name(self) -> str:
        """What the array is called in the result."""
        return self.folder.name

    @property
    def shape(self) -> tuple[int, ...]:
        """Values along each axis."""
        return tuple(self.array.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of its values once they are unpacked: float32 where they were packed."""
        is_packed = self._fills or {_SCALE, _OFFSET} & set(self.array.attrs)
        return np.dtype(np.float32) if is_packed and self.array.dtype.kind in "iu" else self.array.dtype

    def stored(self, key: tuple[Any, ...]) -> NDArray[Any]:
        """Values as they are stored, by a slice or indices for each axis.

        Raises `StoreError`, also where the array is no longer the one that was opened.
        """
        try:
            values: NDArray[Any] = np.asarray(self.array.oindex[key])
        except FAILURES as error:
            self._require_unchanged()
            raise self.damaged(error) from error
        self._require_unchanged()
        return values

    def _require_unchanged(self) -> None:
        try:
            is_same = _files(self.folder) == self.files
        except OSError as error:
            if is_away(error):
                raise drive_error(self.folder.parent, error) from error
            is_same = False
        if not is_same:
            raise StoreError(
                f"The result {self.folder.parent} was moved, removed or replaced since it was opened. Load it"
                " again from where it is now."
            )

    def values(self, key: tuple[Any, ...]) -> NDArray[Any]:
        """Values unpacked by CF's conventions, NaN where there is none; raises `StoreError`."""
        stored = self.stored(key)
        if self.dtype == stored.dtype and not (self._fills or {_SCALE, _OFFSET} & set(self.array.attrs)):
            return stored
        try:
            found = stored.astype(self.dtype)
            for fill in self._fills:
                found[stored == fill] = np.nan
            for convention, act in ((_SCALE, np.multiply), (_OFFSET, np.add)):
                if convention in self.array.attrs:
                    act(found, found.dtype.type(self.array.attrs[convention]), out=found)
        except FAILURES as error:
            raise self.damaged(error) from error
        return found

    @property
    def _fills(self) -> tuple[float, ...]:
        """What stands for no value; floating-point numbers have NaN, whose text is not looked for."""
        named = (self.array.attrs.get(name) for name in _FILLS)
        return tuple(each for each in named if isinstance(each, int | float))


def stored_arrays(path: Path, damaged: Callable[[Exception], StoreError]) -> dict[str, StoredArray]:
    """Every array of a folder by its name.

    ``damaged`` turns what zarr raises into the error that readers get, at once or when a chunk is read.
    """
    path = path.absolute()  # it is read later, when a script may be in another folder
    try:
        group = zarr.open_group(path, mode="r", zarr_format=3, use_consolidated=False)
        return {name: _checked(array, path / name, damaged) for name, array in group.arrays()}
    except FAILURES as error:
        raise damaged(error) from error


def _checked(array: zarr.Array[Any], folder: Path, damaged: Callable[[Exception], StoreError]) -> StoredArray:
    files = _files(folder)
    _require_honest(array, folder.name, sum(size for _, size, _ in files))
    if not isinstance(array.metadata.attributes, dict):
        raise ValueError(f"the attributes of {folder.name} have no names")
    dims = array.metadata.dimension_names or ()  # type: ignore[union-attr]
    if len(dims) != array.ndim or None in dims:
        raise ValueError(f"{folder.name} does not name its axes")
    return StoredArray(tuple(str(each) for each in dims), array, folder, files, damaged)


def _files(folder: Path) -> _Files:
    """The files of an array, by which another one in its place is told; raises ``OSError``."""
    found = ((path, path.stat()) for path in sorted(folder.rglob("*")))
    return tuple((str(at), is_.st_size, is_.st_mtime_ns) for at, is_ in found if stat.S_ISREG(is_.st_mode))


def _require_honest(array: zarr.Array[Any], name: str, there: int) -> None:
    """Refuse an array that declares far more than its files can hold, before anything is allocated."""
    if array.nbytes > MOST_BYTES and array.nbytes > MOST_RATIO * there:
        raise ValueError(f"{name} declares {array.nbytes / 1e6:.0f} MB, which its {there} bytes cannot hold")
