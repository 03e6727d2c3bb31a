"""Two results of one view against each other, pixel by pixel; neither is the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.evaluation.scatter import mean_std, median_std, rms_std
from dsl_core.evaluation.verdict import Verdict, estimate_row
from dsl_core.progress import NoProgress, Progress

Floats = NDArray[np.floating[Any]]
#: A figure in words, its value, standard deviation (None: counted, not estimated), unit and format.
Row = tuple[str, float, float | None, str, str]
#: Columns and rows of the camera's picture that a result is of, None where it does not say.
Places = tuple[NDArray[np.int64] | None, NDArray[np.int64] | None]
#: Bands of two results this close are the same, nm.
SAME_BAND_NM = 0.01
#: Field, that of its deviation, words, unit and format of every row, in the order of the table.
_FIGURES = (
    ("depth_rms_mm", "depth_rms_std_mm", "Depth, RMS difference", "mm", ".3f"),
    ("depth_bias_mm", "depth_bias_std_mm", "Depth, mean difference", "mm", "+.3f"),
    ("depth_median_abs_mm", "depth_median_abs_std_mm", "Depth, median of absolute difference", "mm", ".3f"),
    ("reflectance_rms", "reflectance_rms_std", "Reflectance, RMS difference", "", ".4f"),
    ("reflectance_bias", "reflectance_bias_std", "Reflectance, mean difference", "", "+.4f"),
    ("mean_angle_rad", "mean_angle_std_rad", "Mean spectral angle", "rad", ".4f"),
)


@dataclass(frozen=True)
class ResultDifference:
    """Second minus first over pixels that both have.

    ``share`` is that part of the pixels that either has. Reflectance figures are None without common bands.
    Deviations follow from how a figure scatters over the picture, None where too little of it is known.
    """

    pixels: int
    share: float
    depth_rms_mm: float
    depth_bias_mm: float
    depth_median_abs_mm: float
    bands: int = 0
    reflectance_rms: float | None = None
    reflectance_bias: float | None = None
    mean_angle_rad: float | None = None
    depth_rms_std_mm: float | None = None
    depth_bias_std_mm: float | None = None
    depth_median_abs_std_mm: float | None = None
    reflectance_rms_std: float | None = None
    reflectance_bias_std: float | None = None
    mean_angle_std_rad: float | None = None


def shared_bands(first_nm: Floats, second_nm: Floats) -> list[tuple[int, int]]:
    """Pairs of bands, by number in each, at the same wavelength."""
    if not (len(first_nm) and len(second_nm)):
        return []
    nearest = [int(np.abs(second_nm - nm).argmin()) for nm in first_nm]
    return [(i, k) for i, k in enumerate(nearest) if abs(second_nm[k] - first_nm[i]) <= SAME_BAND_NM]


def compare_results(
    first_mm: Floats,
    second_mm: Floats,
    first: Floats | None = None,
    second: Floats | None = None,
    bands: list[tuple[int, int]] | None = None,
    progress: Progress | None = None,
) -> ResultDifference:
    """Compare depth (h, w) and reflectance (bands, h, w) over pairs of bands; NaN where there is nothing.

    Bands that no pixel has in both are left out.

    Raises `DecodeError` when the sizes differ or no pixel has a depth in both.
    """
    require_same_size(first_mm, second_mm)
    both = np.isfinite(first_mm) & np.isfinite(second_mm)
    either = int((np.isfinite(first_mm) | np.isfinite(second_mm)).sum())
    if not both.any():
        raise DecodeError("No pixel has a depth in both results, so they cannot be compared.")
    errors = second_mm.astype(np.float64) - first_mm
    error = errors[both]
    depth = ResultDifference(
        pixels=error.size,
        share=error.size / either,
        depth_rms_mm=float(np.sqrt(np.mean(error**2))),
        depth_bias_mm=float(error.mean()),
        depth_median_abs_mm=float(np.median(np.abs(error))),
        depth_rms_std_mm=rms_std(errors),
        depth_bias_std_mm=mean_std(errors),
        depth_median_abs_std_mm=median_std(np.abs(errors)),
    )
    if first is None or second is None or not bands:
        return depth
    return _with_spectra(depth, first, second, bands, progress or NoProgress())


def require_same_size(first: Floats, second: Floats) -> None:
    """Raise `DecodeError` when two images cannot be laid over each other."""
    if first.shape[-2:] != second.shape[-2:]:
        sizes = [f"{image.shape[-1]} x {image.shape[-2]}" for image in (first, second)]
        raise DecodeError(
            f"The results have {sizes[0]} and {sizes[1]} pixels. Choose two of the same camera and region."
        )


def require_same_places(first: Places, second: Places) -> None:
    """Raise `DecodeError` when two results of one size are of different parts of the camera's picture."""
    for a, b in zip(first, second, strict=True):
        if a is not None and b is not None and not np.array_equal(a, b):
            extents = f"{_extent(first)}, and {_extent(second)}"
            raise DecodeError(
                f"The results are of different parts of the picture ({extents})."
                " Choose two of the same region, or reconstruct both of it."
            )


def _extent(places: Places) -> str:
    """From where to where a part goes, in words."""
    return ", ".join(
        f"{axis} {at[0]} to {at[-1]}" for axis, at in zip("xy", places, strict=True) if at is not None
    )


def _with_spectra(
    depth: ResultDifference, first: Floats, second: Floats, bands: list[tuple[int, int]], progress: Progress
) -> ResultDifference:
    size = first.shape[-2:]
    # Sums band by band: the cubes are large, their difference would be as large again.
    square, total, product, powers = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros((2, *size))
    common = 0
    for done, (i, k) in enumerate(bands):
        progress.report("compare bands", done, len(bands))
        a, b = first[i].astype(np.float64), second[k].astype(np.float64)
        change = b - a
        if not np.isfinite(change).any():
            continue  # a band that no pixel has in both would leave no pixel to compare
        common += 1
        square += change**2
        total += change
        product += a * b
        powers += (a**2, b**2)
    known = np.isfinite(square)
    if not (common and known.any()):
        return depth
    norm = np.sqrt(powers[0] * powers[1])
    cosine = np.divide(product, norm, out=np.zeros_like(norm), where=norm > 0)
    angle = np.where(known, np.arccos(cosine.clip(-1, 1)), np.nan)
    square, total = square / common, total / common
    return replace(
        depth,
        bands=common,
        reflectance_rms=float(np.sqrt(square[known].mean())),
        reflectance_bias=float(total[known].mean()),
        mean_angle_rad=float(angle[known].mean()),
        reflectance_rms_std=rms_std(np.sqrt(square)),
        reflectance_bias_std=mean_std(total),
        mean_angle_std_rad=mean_std(angle),
    )


def figures(found: ResultDifference) -> tuple[Row, ...]:
    """All figures that there are, in the order of the table."""
    rows: list[Row] = [("Pixels that both have", 100 * found.share, None, "%", ".2f")]
    for field, std_field, words, unit, form in _FIGURES:
        value = getattr(found, field)
        if value is not None:
            rows.append((words, value, getattr(found, std_field), unit, form))
    if found.bands:
        rows.append(("Common bands", found.bands, None, "", ".0f"))
    return tuple(rows)


def difference_table(found: ResultDifference) -> tuple[Verdict, ...]:
    """The figures as rows of a table."""
    return tuple(estimate_row(*each) for each in figures(found))
