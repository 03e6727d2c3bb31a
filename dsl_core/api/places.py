"""Places of a picture, as scripts say them: a mask, a pixel, or a rectangle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError

if TYPE_CHECKING:
    import xarray as xr

#: A mask (rows, columns), a pixel (x, y), or x, y, width and height, in pixels of the whole picture.
Place = NDArray[np.bool_] | Sequence[int]


def place_mask(result: xr.Dataset, place: Place, name: str = "The region") -> NDArray[np.bool_]:
    """The mask (rows, columns) of a place of a result, called ``name``.

    Raises `DecodeError` for what is not a place, and for one outside the result.
    """
    given, rows, columns = np.asarray(place), result["y"].values, result["x"].values
    if given.dtype == bool:
        if given.shape == (len(rows), len(columns)):
            return given
        raise DecodeError(
            f"{name}: the mask has shape {given.shape}; the result has {len(rows)} rows and {len(columns)}"
            " columns."
        )
    is_whole = given.dtype.kind in "iuf" and bool((given == np.rint(given)).all())
    if given.shape not in ((2,), (4,)) or not is_whole:
        raise DecodeError(
            f"{name}: a place is a mask of {len(rows)} x {len(columns)}, a pixel x, y, or x, y, width,"
            f" height in whole pixels; given {place!r}."
        )
    x, y, width, height = (*(int(value) for value in given), 1, 1)[:4]
    inside_y, inside_x = (rows >= y) & (rows < y + height), (columns >= x) & (columns < x + width)
    if not (inside_y.any() and inside_x.any()):
        raise DecodeError(
            f"{name}: x {x}, y {y}, width {width}, height {height} is outside the result"
            f" ({extent_of(result)}). Choose a place inside it."
        )
    return np.asarray(inside_y[:, None] & inside_x)


def extent_of(result: xr.Dataset) -> str:
    """From where to where a result goes, in words."""
    rows, columns = result["y"].values, result["x"].values
    return f"x {columns[0]} to {columns[-1]}, y {rows[0]} to {rows[-1]}"
