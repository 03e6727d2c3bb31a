"""Spectra of chosen pixels as a table: one row per pixel and band, units in the names of the columns.

Lines that begin with ``#`` say where the data come from; ``pandas.read_csv(..., comment="#")`` skips them.
What has no answer is written as ``nan``.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from dsl_core.errors import StoreError
from dsl_core.io.export.common import provenance, require, require_suffix, wavelengths_nm
from dsl_core.io.export.wording import deviation_text, figure_text, header_lines
from dsl_core.io.staging import staged
from dsl_core.model.result import Reach, reasons
from dsl_core.model.result_order import columns_and_rows_px, lie_between_pixels
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr

#: (x, y) of a pixel: column and row in the whole picture, counted from 0.
Pixel = tuple[int, int]

HEADER = (
    "x_px",
    "y_px",
    "depth_mm",
    "depth_std_mm",
    "wavelength_nm",
    "reflectance",
    "reflectance_std",
    "data_share",
    "reach",
    "flags",
    "reasons",
)


def export_csv(
    result: xr.Dataset,
    path: Path,
    *,
    overwrite: bool = False,
    pixels: Sequence[Pixel] = (),
    check: Check = never,
) -> list[Path]:
    """Write the spectra of pixels given as (x, y), of each once.

    Raises `StoreError` when no pixel is given, one is outside the image, or one is not two numbers.
    """
    pixels = list(dict.fromkeys(whole_pixels(pixels)))
    require_suffix(path, ".csv")
    require(result, "A table of spectra", "reflectance", "wavelength_nm")
    _check_pixels(result, pixels)
    with (
        staged([path], overwrite=overwrite) as (draft,),
        draft.open("w", newline="", encoding="utf-8") as file,
    ):
        file.writelines(header_lines(provenance(result)))
        writer = csv.writer(file)
        writer.writerow(HEADER)
        for pixel in pixels:
            check()
            writer.writerows(_rows(result, pixel))
    return [path]


def whole_pixels(given: ArrayLike) -> list[Pixel]:
    """Pixels (x, y) from a list or an array of them, or from one; raises `StoreError` for anything else."""
    try:
        values = np.atleast_2d(np.asarray(given, float))
        if not values.size:
            return []
        with np.errstate(invalid="ignore"):
            whole = values.astype(int)
    except (TypeError, ValueError):
        values = whole = np.empty(0)
    if values.shape[1:] != (2,) or (whole != values).any():
        raise StoreError(f"A pixel is x, y in whole pixels, as in [(50, 30), (60, 40)]; given {given!r}.")
    return [(x, y) for x, y in whole.tolist()]


def _check_pixels(result: xr.Dataset, pixels: Sequence[Pixel]) -> None:
    xs, ys = _coordinates(result)
    width, height = len(xs), len(ys)
    if not pixels:
        raise StoreError(
            f"A table of spectra needs pixels: give at least one as x,y within {width} x {height}."
        )
    if any(axis in result.coords and lie_between_pixels(result[axis].values) for axis in ("x", "y")):
        raise StoreError(
            "The pixels of this result are averages over several, whose coordinates are not whole"
            " numbers, so x,y names none of them. Export spectra of places instead, such as by"
            " 'dsl-scan spectra --at'."
        )
    outside = [f"({x}, {y})" for x, y in pixels if x not in xs or y not in ys]
    if outside:
        raise StoreError(
            f"No such pixel: {', '.join(outside)}. The image has {width} x {height} pixels: x runs from"
            f" {xs[0]} to {xs[-1]}, y from {ys[0]} to {ys[-1]}."
        )


def _coordinates(result: xr.Dataset) -> tuple[list[int], list[int]]:
    """The x and y of a result's pixels in the whole picture, of which it may be a part."""
    xs, ys = columns_and_rows_px(result)
    return xs.tolist(), ys.tolist()


def _rows(result: xr.Dataset, pixel: Pixel) -> Iterator[tuple[object, ...]]:
    x, y = pixel
    xs, ys = _coordinates(result)
    spot = result.isel(x=xs.index(x), y=ys.index(y)).load()
    flags = int(spot["flags"]) if "flags" in spot else 0
    depth = _with_deviation(spot, "depth_mm", "depth_std_mm")
    for band, wavelength in enumerate(wavelengths_nm(result)):
        reach = _reach_in_words(int(spot["reach"][band])) if "reach" in spot else ""
        spectrum = _with_deviation(spot, "reflectance", "reflectance_std", band)
        spectrum.append(deviation_text(_number(spot, "data_share", band)) or "nan")
        yield x, y, *depth, f"{wavelength:g}", *spectrum, reach, flags, "; ".join(reasons(flags))


def _with_deviation(spot: xr.Dataset, name: str, std_name: str, band: int | None = None) -> list[str]:
    """A value and its standard deviation, as `figure_text` says them; ``nan`` for what is not there."""
    value, std = _number(spot, name, band), _number(spot, std_name, band)
    return [figure_text(value, std) or "nan", deviation_text(std) or "nan"]


def _number(spot: xr.Dataset, name: str, band: int | None = None) -> float:
    if name not in spot:
        return float("nan")
    values = spot[name].values
    return float(values if band is None else values[band])


def _reach_in_words(reach: int) -> str:
    """Which light measured a band.

    >>> _reach_in_words(3)
    '+1 and -1'
    """
    words = {Reach.PLUS_ONE: "+1", Reach.MINUS_ONE: "-1", Reach.ZERO_ONLY: "zero order only"}
    return " and ".join(word for bit, word in words.items() if reach & bit) or "none"
