"""Places of a picture, as scripts say them: a mask, a pixel, or a rectangle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.result_order import BANDS

if TYPE_CHECKING:
    import xarray as xr

#: A mask (rows, columns), a pixel (x, y), or x, y, width and height, in pixels of the whole picture.
Place: TypeAlias = "NDArray[np.bool_] | xr.DataArray | Sequence[int]"
#: The axes of a mask.
_AXES = ("y", "x")


def place_mask(result: xr.Dataset, place: Place, name: str = "The region") -> NDArray[np.bool_]:
    """The mask (rows, columns) of a place of a result, called ``name``.

    A mask that names its axes ``x`` and ``y`` may have them in any order, and marks the pixels that its own
    coordinates say. Raises `DecodeError` for what is not a place, and for one outside the result.
    """
    given, rows, columns = _by_names(result, place, name), result["y"].values, result["x"].values
    if given.dtype == bool:
        if given.shape == (len(rows), len(columns)):
            return given
        raise DecodeError(
            f"{name}: the mask has shape {given.shape}; the result has {len(rows)} rows and {len(columns)}"
            " columns."
        )
    numbers = whole_numbers(given)
    if numbers is None or len(numbers) not in (2, 4):
        raise DecodeError(
            f"{name}: a place is a mask of {len(rows)} x {len(columns)}, a pixel x, y, or x, y, width,"
            f" height in whole pixels; given {repr(place).splitlines()[0]}."
        )
    x, y, width, height = (*numbers, 1, 1)[:4]
    inside_y, inside_x = (rows >= y) & (rows < y + height), (columns >= x) & (columns < x + width)
    if not (inside_y.any() and inside_x.any()):
        raise DecodeError(
            f"{name}: x {x}, y {y}, width {width}, height {height} is outside the result"
            f" ({extent_of(result)}). Choose a place inside it."
        )
    return np.asarray(inside_y[:, None] & inside_x)


def masks_of(result: xr.Dataset, pins: Mapping[str, Place]) -> dict[str, NDArray[np.bool_]]:
    """Masks (rows, columns) of places by their names, as `place_mask` makes them; raises `DecodeError`."""
    if not isinstance(pins, Mapping):
        raise DecodeError(
            f"Places are given by names, such as {{'leaf': (50, 30)}}; given a {type(pins).__name__}."
        )
    return {name: place_mask(result, place, name) for name, place in pins.items()}


def require_result(given: object) -> None:
    """Raise `DecodeError` for what is no dataset, such as the path of a result."""
    import xarray as xr

    if not isinstance(given, xr.Dataset):
        raise DecodeError(
            "A result is needed, as reconstruct and load_result return it; what was given is of type"
            f" {type(given).__name__}."
        )


def require_picture(result: xr.Dataset) -> None:
    """Raise `DecodeError` for what has no rows or no columns, such as one spectrum."""
    require_result(result)
    lacking = [axis for axis in _AXES if axis not in result.dims]
    if len(lacking) == 2:
        raise DecodeError("This is one spectrum, not a result: it has no pixels to choose from.")
    seen = (result[name].dims for name in ("depth_mm", "reflectance") if name in result)
    others = sorted({str(axis) for dims in seen for axis in dims} - {*_AXES, BANDS})
    if lacking and others:
        raise DecodeError(
            f"The result has no axis {lacking[0]}; pixels are over {', '.join(others)}. Rename the axis,"
            f" such as result.rename({others[0]}={lacking[0]!r})."
        )
    if lacking:
        raise DecodeError(
            f"The result has no axis {lacking[0]}, since one {lacking[0]} of it was chosen. Choose a list of"
            f" one, such as result.isel({lacking[0]}=[30]), which keeps the axis."
        )
    if others:
        raise DecodeError(
            f"The result has one more axis than a picture, {others[0]}. Choose one along it, such as"
            f" result.isel({others[0]}=0)."
        )


def whole_numbers(given: object) -> tuple[int, ...] | None:
    """The whole numbers of a sequence; None where it is none, or holds anything else.

    >>> whole_numbers((1, 2.0)), whole_numbers((1, float("inf"))), whole_numbers((1.5, 2))
    ((1, 2), None, None)
    """
    values = as_array(given)
    if values.ndim != 1 or values.dtype.kind not in "iuf":
        return None
    is_whole = np.isfinite(values) & (values == np.rint(values))
    return tuple(int(value) for value in values) if is_whole.all() else None


def as_array(given: Any) -> NDArray[Any]:
    """What was given as an array; without a value where lists in it differ in length, or there is none.

    What numpy has masked nobody knows: in a mask it marks no pixel, and among numbers none of them counts.
    """
    if np.ma.is_masked(given):
        return np.asarray(given.filled(False)) if given.dtype == bool else np.empty(0, object)
    try:
        return np.asarray(given)
    except (ValueError, TypeError):
        return np.empty(0, object)


def _by_names(result: xr.Dataset, place: Place, name: str) -> NDArray[Any]:
    """A place as numbers; a mask with axes that have names is put on rows and columns of the result."""
    import xarray as xr

    if not isinstance(place, xr.DataArray) or not set(_AXES) & set(place.dims):
        return as_array(place)
    if set(place.dims) != set(_AXES):
        raise DecodeError(
            f"{name}: the axes of the mask are {', '.join(map(str, place.dims))}."
            " Give one over y and x alone."
        )
    for axis in _AXES:
        if axis in place.coords and axis in result.coords:
            place = _on_axis(result, place, axis, name)
    return np.asarray(place.transpose(*_AXES).values)


def _on_axis(result: xr.Dataset, mask: xr.DataArray, axis: str, name: str) -> xr.DataArray:
    """The mask at the coordinates of the result on one axis; raises `DecodeError` where it lacks any."""
    wanted, own = result[axis].values, mask.get_index(axis)
    if np.array_equal(own, wanted):
        return mask
    places = own.get_indexer(wanted) if own.is_unique else np.full(len(wanted), -1)
    if (places < 0).any():
        raise DecodeError(
            f"{name}: the mask is that of another place: its {axis} goes from {own[0]} to {own[-1]}, that of"
            f" the result from {wanted[0]} to {wanted[-1]}. Give a mask of this result, or of one that"
            " contains it."
        )
    return mask.isel({axis: places})


def extent_of(result: xr.Dataset) -> str:
    """From where to where a result goes, in words."""
    rows, columns = result["y"].values, result["x"].values
    return f"x {columns[0]} to {columns[-1]}, y {rows[0]} to {rows[-1]}"
