"""A result written to disk as it is made, some rows at a time, which is resumed where a run was interrupted.

Until it is finished the result is in a hidden folder next to its place, ``.NAME.unfinished``: its arrays, and
a file for each band of rows that is complete. What it is a result of is in ``key.json``; another run resumes
it only if that is the same to the letter. An empty file ``overwrite`` says that an older result is replaced.
"""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import zarr
from numpy.typing import NDArray

from dsl_core.io.atomic import PARTIAL_SUFFIX, make_folder, make_safe, store_error, write_atomic
from dsl_core.io.reading import read_bounded
from dsl_core.io.result.arrays import EMPTY_TOO, PACKINGS, encoded, fits, new_array, stored_as, write_variable
from dsl_core.io.result.result_file import RESULT_FOLDER, labels_of, opened, seal_folder
from dsl_core.io.scan.lock import FolderLock
from dsl_core.io.staging import check_targets, put_in_place
from dsl_core.model.result import VARIABLES, build_result
from dsl_core.model.result_sink import Maps

if TYPE_CHECKING:
    import xarray as xr

_log = logging.getLogger(__name__)
_KEY, _LOCK, _ARRAYS, _OVERWRITE = "key.json", "writer.lock", "result.zarr", "overwrite"


class RowWriter:
    """A `ResultSink` on disk. Used in a ``with`` block, after which nothing is locked."""

    def __init__(
        self,
        target: Path,
        key: str,
        *,
        overwrite: bool = False,
        seen_rows: Callable[[int, int], object] | None = None,
    ) -> None:
        """Nothing is written before `begin`. ``key`` is all that the result depends on, as a text.

        ``seen_rows`` is told how many rows are there, and of how many, whenever there are more. Raises
        `StoreError` where the target exists (unless ``overwrite``, and it is a result too).
        """
        check_targets([target], overwrite=overwrite, kind=RESULT_FOLDER)
        self._target, self._key, self._overwrite = target, key, overwrite
        self._seen_rows, self._rows_there = seen_rows, 0
        self.work = target.with_name(f".{target.name}.unfinished")
        self._lock: FolderLock | None = None
        self._labels: dict[str, list[str]] = {}

    def begin(
        self,
        shape: tuple[int, int],
        origin: tuple[int, int],
        wavelengths_nm: NDArray[np.float64],
        bands: Sequence[slice],
    ) -> None:
        """Expect the rows of a picture of a shape, in bands like the first; some may be higher or less high.

        Raises `StoreError` where another process writes to the same place, or the disk fails.
        """
        make_folder(self.work)
        self._lock = FolderLock(self.work / _LOCK)
        self._shape, self._origin, self._nm = shape, origin, wavelengths_nm
        self._bands, self._height = tuple(bands), bands[0].stop
        key = f"{self._key}\n{shape} {origin} {self._height} {wavelengths_nm.tolist()}".encode()
        with self._writing():
            if self._is_of(key):
                for leftover in (self.work / _ARRAYS).rglob("*" + PARTIAL_SUFFIX):
                    leftover.unlink()  # of zarr, which writes beside a file as we do, and was killed
                for folder in (self.work / _ARRAYS).iterdir():
                    if folder.is_dir() and folder.name not in VARIABLES:
                        shutil.rmtree(folder)  # an axis, which may lack its values and would read as zeros
                done = len(list(self.work.glob("rows.*.json")))
                _log.warning(
                    "Continued where a run was interrupted: %d of %d bands are there.", done, len(bands)
                )
            else:
                self._clear()
                zarr.create_group(self.work / _ARRAYS, zarr_format=3)
                write_atomic(self.work / _KEY, key)
            if self._overwrite:
                (self.work / _OVERWRITE).touch()
            else:
                (self.work / _OVERWRITE).unlink(missing_ok=True)

    def note_of(self, rows: slice) -> str | None:
        """The note of rows that are complete; None for others."""
        path = self._note(rows)
        if not path.is_file():
            return None
        self._count(rows)
        return read_bounded(path).decode()

    def put(self, rows: slice, maps: Maps, note: str) -> None:
        """Write the maps (..., rows, columns) of a band of rows; raises `StoreError`."""
        part = build_result(dict(maps), self._nm, {})
        with self._writing(), zarr.config.set(EMPTY_TOO):
            group = self._group()
            for name in maps:
                self._write(group, name, part[name].variable, rows)
            # The note comes last, and once all else is safe: rows without one are made again.
            write_atomic(self._note(rows), note.encode())
        self._count(rows)

    def _count(self, rows: slice) -> None:
        self._rows_there += rows.stop - rows.start
        if self._seen_rows is not None:
            self._seen_rows(self._rows_there, self._shape[0])

    def _write(self, group: zarr.Group, name: str, part: xr.Variable, rows: slice) -> None:
        packing, values = PACKINGS.get(name), np.asarray(part.values)
        fitting = packing is not None and fits(values, packing)
        # Whatever is opened is read from the disk: once for each variable.
        array: Any = group.get(name)
        if array is None:
            array = self._create(group, name, part, fitting)
        elif "scale_factor" in array.attrs and not fitting:
            array = self._widen(group, name, part)
        packed = packing if "scale_factor" in array.attrs else None
        self._store(array, name, rows, encoded(values, array.dtype, packed))

    def _store(self, array: zarr.Array[Any], name: str, rows: slice, values: NDArray[Any]) -> None:
        """Write rows, safe before their note is: a chunk that a power cut has taken reads as zeros."""
        array[..., rows, :] = values
        before = ["0"] * (array.ndim - 2)
        for chunk in range(rows.start // self._height, -(-rows.stop // self._height)):
            make_safe(self.work / _ARRAYS / name / "c" / Path(*before, str(chunk), "0"))

    def _create(self, group: zarr.Group, name: str, part: xr.Variable, fitting: bool) -> zarr.Array[Any]:
        kind, encoding = stored_as(name, part, fitting)
        shape = (*part.shape[:-2], *self._shape)
        return new_array(group, name, part, shape, kind, encoding, (self._height, self._shape[1]))

    def _widen(self, group: zarr.Group, name: str, part: xr.Variable) -> zarr.Array[Any]:
        """Store a variable as float32 from now on: some of its values are out of the range of its packing."""
        packing, aside = PACKINGS[name], self.work / f"{name}.packed"
        os.replace(self.work / _ARRAYS / name, aside)
        old = zarr.open_array(aside, mode="r", zarr_format=3)
        wide = self._create(group, name, part, fitting=False)
        for rows in self._bands:
            if self._note(rows).is_file():
                steps = np.asarray(old[..., rows, :])
                values = steps.astype(np.float32) * np.float32(packing.step)
                self._store(wide, name, rows, np.where(steps == packing.fill, np.float32(np.nan), values))
        shutil.rmtree(aside)
        return wide

    def finish(self, attributes: dict[str, str | int | float]) -> xr.Dataset:
        """The whole result, read from the disk when it is used; it is in its place after `publish`.

        Raises `StoreError`.
        """
        group = self._group()
        shapes = {name: array.shape for name, array in group.arrays()}
        nothing = np.zeros((), np.int8)
        empty: dict[str, NDArray[np.generic]] = {
            name: np.broadcast_to(nothing, shapes[name]) for name in VARIABLES if name in shapes
        }
        like = build_result(empty, self._nm, attributes, self._origin)
        self._labels = labels_of(like)
        with self._writing():
            for name, variable in like.coords.variables.items():
                if name not in self._labels:
                    write_variable(group, str(name), variable)
        return opened(self.work / _ARRAYS, {**like.attrs, "labels": self._labels})

    def publish(self, attributes: Mapping[Any, Any]) -> Path:
        """Move the result to its place, whole or not at all, with its attributes; raises `StoreError`."""
        with self._writing():
            seal_folder(self.work / _ARRAYS, {**attributes, "labels": self._labels})
            arrays, place = self.work / _ARRAYS, self._target
            try:
                put_in_place(arrays, place, overwrite=self._overwrite, kind=RESULT_FOLDER)
            finally:
                if not arrays.is_dir():  # the result is in its place, and there is nothing to resume
                    self._tidy()
        return self._target

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        """Let others write; what is not worth resuming is removed."""
        if self._lock is None:
            return
        if not any(self.work.glob("rows.*.json")):
            self._tidy()
        self._lock.release()
        self._lock = None
        with contextlib.suppress(OSError):
            if [path.name for path in self.work.iterdir()] == [_LOCK]:
                shutil.rmtree(self.work)

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Say in a sentence what the disk refuses."""
        try:
            yield
        except OSError as error:
            raise store_error(self._target, error) from error

    def _is_of(self, key: bytes) -> bool:
        """Whether what is there is the beginning of the same result."""
        path = self.work / _KEY
        half = any(self.work.glob("*.packed"))
        return path.is_file() and read_bounded(path) == key and (self.work / _ARRAYS).is_dir() and not half

    def _tidy(self) -> None:
        """Remove what nobody needs any more; what a drive keeps, the next run removes."""
        with contextlib.suppress(OSError):
            self._clear()

    def _clear(self) -> None:
        """Remove all but the lock."""
        for path in self.work.iterdir():
            if path.is_dir():
                shutil.rmtree(path)
            elif path.name != _LOCK:
                path.unlink()

    def _note(self, rows: slice) -> Path:
        return self.work / f"rows.{rows.start}.{rows.stop}.json"

    def _group(self) -> zarr.Group:
        return zarr.open_group(self.work / _ARRAYS, mode="r+", zarr_format=3, use_consolidated=False)
