"""Where the pixels of a result are in the camera's picture, of which a result may be a part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import xarray as xr


def places_px(coordinate: ArrayLike) -> NDArray[np.int64] | None:
    """Columns or rows of the camera's picture by a coordinate x or y of a result.

    None where it is not of distinct whole numbers: such a coordinate names no pixels.

    >>> places_px([100.0, 101.0]), places_px([0.5, 1.5])
    (array([100, 101]), None)
    """
    values = np.asarray(coordinate)
    if values.ndim != 1 or values.dtype.kind not in "iuf" or not values.size:
        return None
    with np.errstate(invalid="ignore"):
        places = values.astype(np.int64)
    is_whole = bool((places == values).all())
    return places if is_whole and len(np.unique(places)) == places.size else None


def columns_and_rows_px(result: xr.Dataset) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Columns and rows of the camera's picture of a result's pixels; counted from 0 where it does not say."""
    columns, rows = (places_px(result[axis].values) if axis in result.coords else None for axis in ("x", "y"))
    return (
        np.arange(result.sizes["x"]) if columns is None else columns,
        np.arange(result.sizes["y"]) if rows is None else rows,
    )
