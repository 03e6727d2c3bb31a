"""Pictures as arrays: files of NumPy (.npy, .npz) and of MATLAB (.mat; version 7.3 is HDF5 and not read).

A file may hold other arrays, too: those whose names say that they are patterns, or something else than what
the camera saw, are left out where that leaves pictures.
"""

from __future__ import annotations

import math
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.reading import array_header, read_array, require_plain
from dsl_core.words import natural

SUFFIXES = {".npy", ".npz", ".mat"}
#: Files of these may also hold anything else, such as a calibration.
ARCHIVES = {".npz", ".mat"}
#: Larger than any capture that is saved as one file, in bytes of the file and of its values.
MOST_BYTES = 1 << 30
#: No camera has fewer rows or columns, and no capture fewer pictures.
FEWEST_PX, FEWEST = 8, 4
_COLOURS = (3, 4)
_OTHER = re.compile(r"patt|proj|code|mask|truth|depth|calib|xyz|point", re.IGNORECASE)
#: Pictures that a capture has besides those of its patterns, and that may have a name of their own.
_ENDS = re.compile(r"white|black|dark|ambient|full|(?<![a-z])o(?:n|ff)(?![a-z])", re.IGNORECASE)
#: Names of a picture without the projector's light: the first that a file has is its black.
_UNLIT = (r"black|(?<![a-z])off(?![a-z])", "ambient", "dark")
#: Bytes of a number by MATLAB's name of its type.
_MATLAB_BYTES = {"logical": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4} | {
    "single": 4, "double": 8,
}  # fmt: skip
#: What NumPy and SciPy raise for a damaged file; names are those of SciPy's own variables.
_DAMAGED = (
    *(OSError, EOFError, ValueError, TypeError, LookupError, ArithmeticError, MemoryError),
    *(struct.error, zlib.error, zipfile.BadZipFile, NotImplementedError, AttributeError, NameError),
)

Shapes = Mapping[str, tuple[int, ...]]


def read_pictures(path: Path) -> NDArray[Any]:
    """The pictures of a file, (pictures, rows, columns) or (..., 3), or its only one; raises `StoreError`."""
    try:
        _require_bytes(path, require_plain(path))
        values = _READERS[path.suffix.lower()](path)
    except _DAMAGED as error:
        raise StoreError(f"{path} is not an array that can be read ({error}). Save it again.") from error
    if values.dtype.kind not in "uifb":
        raise StoreError(f"{path} does not hold numbers but {values.dtype}. Save it again as numbers.")
    return values


def _require_bytes(path: Path, count: int) -> None:
    """Raise `StoreError` for more than a capture has, in the file or in the arrays that it declares."""
    if count > MOST_BYTES:
        raise StoreError(f"{path} is larger than {MOST_BYTES / 1e9:.0f} GB. Save its pictures one by one.")


def _read_archive(path: Path) -> NDArray[Any]:
    with zipfile.ZipFile(path) as archive:
        members = {name.removesuffix(".npy"): name for name in archive.namelist() if name.endswith(".npy")}
        shapes: dict[str, tuple[int, ...]] = {}
        bytes_of: dict[str, int] = {}
        for name, member in members.items():
            with archive.open(member) as file:
                shape, dtype = array_header(file)
            if dtype.kind in "uifb":
                shapes[name], bytes_of[name] = shape, math.prod(shape) * dtype.itemsize
    chosen = _chosen(path, shapes, pictures_last=False)
    _require_bytes(path, sum(bytes_of[name] for name in chosen))
    with np.load(path, allow_pickle=False) as arrays:
        return _joined([arrays[name] for name in chosen])


def _read_matlab(path: Path) -> NDArray[Any]:
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatReadError

    try:
        listed = whosmat(path)
        shapes = {name: tuple(shape) for name, shape, kind in listed if kind in _MATLAB_BYTES}
        bytes_of = {name: math.prod(shape) * _MATLAB_BYTES.get(kind, 0) for name, shape, kind in listed}
        if not shapes and any(kind == "cell" for *_, kind in listed):
            raise StoreError(
                f"{path} holds cells. Save one array of pictures, cat(3, pictures{{:}}), instead."
            )
        chosen = _chosen(path, shapes, pictures_last=True)
        _require_bytes(path, sum(bytes_of[name] for name in chosen))
        arrays = loadmat(path, variable_names=chosen)
    except NotImplementedError as error:
        raise StoreError(
            f"{path} is of MATLAB 7.3, which is not read. Save it with '-v7', or its pictures as PNG."
        ) from error
    except MatReadError as error:
        raise ValueError(str(error)) from error
    return _joined([_pictures_first(arrays[name]) for name in chosen])


def _pictures_first(values: NDArray[Any]) -> NDArray[Any]:
    """MATLAB counts pictures with the last axis."""
    return values if _is_picture(values.shape) else np.moveaxis(values, -1, 0)


def _joined(arrays: list[NDArray[Any]]) -> NDArray[Any]:
    if len(arrays) == 1:
        return arrays[0]
    return np.concatenate([each[None] if _is_picture(each.shape) else each for each in arrays])


def _chosen(path: Path, shapes: Shapes, pictures_last: bool) -> list[str]:
    """Names of the arrays that are the pictures of a capture; raises `StoreError`.

    That is one of all pictures, with white and black that have arrays of their own before it, or one for each
    picture in natural order.
    """
    own = {name: shape for name, shape in shapes.items() if not _OTHER.search(name)}
    for among in (own, shapes):
        single = sorted((name for name, shape in among.items() if _is_picture(shape)), key=natural)
        stacks = {name: _of_one(shape, pictures_last) for name, shape in among.items() if name not in single}
        stacks = {name: shape for name, shape in stacks.items() if _is_picture(shape)}
        if len(stacks) == 1:
            ((name, shape),) = stacks.items()
            ends = [each for each in shapes if _ENDS.search(each) and shapes[each] == shape]
            return [*sorted(_with_one_black(ends), key=natural), name]
        is_whole = len(single) >= FEWEST or among is shapes or len(own) == len(shapes)
        if not stacks and single and is_whole and len({among[name] for name in single}) == 1:
            return single
    listed = ", ".join(f"{name}: {' x '.join(map(str, shape))}" for name, shape in list(shapes.items())[:6])
    raise StoreError(
        f"{path} holds {f'arrays ({listed})' if listed else 'no array of numbers'}, and none alone is the"
        " pictures of a capture. Save those of the camera as one array in a file .npy."
    )


def _with_one_black(names: list[str]) -> list[str]:
    """Names without those of unlit pictures that a better one makes needless."""
    unlit = [[name for name in names if re.search(words, name, re.IGNORECASE)] for words in _UNLIT]
    best = next((found for found in unlit if found), [])
    return [name for name in names if name in best or not any(name in found for found in unlit)]


def _is_picture(shape: tuple[int, ...]) -> bool:
    return (len(shape) == 2 or (len(shape) == 3 and shape[2] in _COLOURS)) and min(shape[:2]) >= FEWEST_PX


def _of_one(shape: tuple[int, ...], pictures_last: bool) -> tuple[int, ...]:
    return shape[:-1] if pictures_last else shape[1:]


_READERS: dict[str, Callable[[Path], NDArray[Any]]] = {
    ".npy": read_array, ".npz": _read_archive, ".mat": _read_matlab,
}  # fmt: skip
