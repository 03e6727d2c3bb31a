"""The order that a result is relied on to have, and where its pixels are in the camera's picture.

xarray goes by names and does not mind an order; arrays do. Other programs, and slices of a person, may store
axes otherwise, bands that fall, or a picture upside down. Masking with `xarray.Dataset.where` makes floats
of whole numbers, and NaN of those that it takes away.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsl_core.errors import StoreError
from dsl_core.model.result import VARIABLES, Flag

if TYPE_CHECKING:
    import xarray as xr

#: The axis of bands.
BANDS = "wavelength_nm"
#: Variables of bits, with their types, and what says of a pixel that it has been taken away.
BITS: dict[str, tuple[type[np.unsignedinteger[Any]], int]] = {
    "flags": (np.uint16, int(Flag.NON_FINITE)),
    "reach": (np.uint8, 0),
}


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


def lie_between_pixels(coordinate: ArrayLike) -> bool:
    """Whether a coordinate x or y is of finite numbers that are not all whole, as means of pixels have.

    >>> lie_between_pixels([0.5, 2.5]), lie_between_pixels([1.0, 4.0])
    (True, False)
    """
    values = np.asarray(coordinate)
    return values.dtype.kind == "f" and bool(np.isfinite(values).all() and (values != np.rint(values)).any())


def columns_and_rows_px(result: xr.Dataset) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Columns and rows of the camera's picture of a result's pixels; counted from 0 where it does not say."""
    columns, rows = (places_px(result[axis].values) if axis in result.coords else None for axis in ("x", "y"))
    return (
        np.arange(result.sizes["x"]) if columns is None else columns,
        np.arange(result.sizes["y"]) if rows is None else rows,
    )


def require_wavelengths(nm: ArrayLike, result: object) -> None:
    """Raise `StoreError` where the bands of a result, called ``result``, have not one wavelength each."""
    values = np.asarray(nm, np.float64)
    if not values.size or not np.isfinite(values).all() or len(np.unique(values)) < values.size:
        raise StoreError(
            f"{result} has a reflectance, but not one wavelength for each of its bands. Add the coordinate"
            f" {BANDS}, in nm."
        )


def wavelengths_of(result: xr.Dataset, called: object = "The result") -> NDArray[np.float64]:
    """The centres (bands,) of a result's bands, nm; raises `StoreError` as `require_wavelengths` does.

    An axis without a coordinate has none, though xarray counts along it where it is asked for one.
    """
    nm = np.asarray(result[BANDS].values if BANDS in result.coords else (), np.float64)
    require_wavelengths(nm, called)
    return nm


def rising_order(values: ArrayLike) -> NDArray[np.intp] | None:
    """The order (n,) in which values rise; None where they do already, or are no finite numbers.

    >>> rising_order([660.0, 430.0]), rising_order([430.0, 660.0])
    (array([1, 0]), None)
    """
    given = np.asarray(values)
    if given.ndim != 1 or given.dtype.kind not in "iuf" or not np.isfinite(given).all():
        return None
    order = np.argsort(given, kind="stable")
    return None if bool((order == np.arange(given.size)).all()) else order


def as_bits(name: str, values: NDArray[Any]) -> NDArray[Any]:
    """Values of a variable named ``name``: bits that masking made floats as whole numbers again.

    NaN in flags becomes `Flag.NON_FINITE`, since nothing is left of such a pixel. Other variables stay as
    they are. Raises `StoreError` for fractions, since a mean of bits names others than those that were set.

    >>> as_bits("flags", np.array([4.0, np.nan])).tolist()
    [4, 512]
    """
    if name not in BITS or values.dtype.kind != "f":
        return values
    kind, taken_away = BITS[name]
    filled = np.where(np.isnan(values), taken_away, values)
    is_bits = (filled >= 0) & (filled <= np.iinfo(kind).max) & (filled == np.rint(filled))
    if not is_bits.all():
        raise StoreError(
            f"The {name} of the result should be whole numbers, but are averages, such as"
            f" {filled[~is_bits].flat[0]:g}. Take the largest instead, such as"
            f" result[{name!r}].coarsen(...).max(), or leave them out by drop_vars({name!r})."
        )
    return filled.astype(kind)


def with_bits(result: xr.Dataset) -> xr.Dataset:
    """A result whose flags and reach are whole numbers, as by `as_bits`; the very dataset if they are.

    Raises `StoreError` where they are averages.
    """
    floats = [name for name in BITS if name in result and result[name].dtype.kind == "f"]
    whole = {name: result[name].copy(data=as_bits(name, result[name].values)) for name in floats}
    return result.assign(whole) if whole else result


def known_bands(cube: NDArray[Any]) -> NDArray[np.bool_]:
    """Bands of a cube (bands, rows, columns) that any pixel has, (bands,); all where no pixel has any."""
    known = np.array([np.isfinite(band).any() for band in cube], bool)
    return known if known.any() else ~known


def without_missing_bands(result: xr.Dataset) -> xr.Dataset:
    """A result with the bands that a pixel has a reflectance in; the very dataset where these are all."""
    if "reflectance" not in result or BANDS not in result["reflectance"].dims:
        return result
    known = known_bands(result["reflectance"].transpose(BANDS, ...).values)
    return result if known.all() else result.isel({BANDS: np.flatnonzero(known)})


def with_axes(result: xr.Dataset) -> xr.Dataset:
    """A result with its axes as `VARIABLES` has them and its bands rising; rows and columns stay as they are.

    Flags are whole numbers, as `with_bits` makes them. It is the very dataset where all that is so already.
    What has other axes, such as one spectrum, keeps them.
    """
    result = _rising(with_bits(result), (BANDS,))
    # Read first: xarray cannot pick single pixels from one that is turned before it is read.
    turned = {
        name: variable.compute().transpose(*VARIABLES[str(name)][0])
        for name, variable in result.data_vars.items()
        if name in VARIABLES
        and variable.dims != VARIABLES[str(name)][0]
        and set(variable.dims) == set(VARIABLES[str(name)][0])
    }
    return result.assign(turned) if turned else result


def canonical(result: xr.Dataset) -> xr.Dataset:
    """As `with_axes`, with columns from left to right and rows from top to bottom by ``x`` and ``y``."""
    return _rising(with_axes(result), ("x", "y"))


def _rising(result: xr.Dataset, axes: tuple[str, ...]) -> xr.Dataset:
    orders = {
        axis: order
        for axis in axes
        if axis in result.coords and result[axis].dims == (axis,)
        for order in (rising_order(result[axis].values),)
        if order is not None
    }
    return result.isel(orders) if orders else result
