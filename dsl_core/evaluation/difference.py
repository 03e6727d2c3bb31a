"""Two results of one view against each other, pixel by pixel; neither is taken for the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.evaluation.verdict import Verdict
from dsl_core.progress import NoProgress, Progress

Floats = NDArray[np.floating[Any]]
#: Bands of two results this close are the same, nm.
SAME_BAND_NM = 0.01


@dataclass(frozen=True)
class ResultDifference:
    """Second minus first over pixels that both have.

    ``share`` is that part of the pixels that either has. Reflectance figures are None without common bands.
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


def shared_bands(first_nm: Floats, second_nm: Floats) -> list[tuple[int, int]]:
    """Pairs of bands, by number in each, that lie at the same wavelength."""
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

    Raises `DecodeError` when the sizes differ or no pixel has a depth in both.
    """
    require_same_size(first_mm, second_mm)
    both = np.isfinite(first_mm) & np.isfinite(second_mm)
    either = int((np.isfinite(first_mm) | np.isfinite(second_mm)).sum())
    if not both.any():
        raise DecodeError("No pixel has a depth in both results, so that they cannot be compared.")
    error = second_mm[both].astype(np.float64) - first_mm[both]
    depth = ResultDifference(
        pixels=error.size,
        share=error.size / either,
        depth_rms_mm=float(np.sqrt(np.mean(error**2))),
        depth_bias_mm=float(error.mean()),
        depth_median_abs_mm=float(np.median(np.abs(error))),
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


def _with_spectra(
    depth: ResultDifference, first: Floats, second: Floats, bands: list[tuple[int, int]], progress: Progress
) -> ResultDifference:
    size = first.shape[-2:]
    # Sums band by band: the cubes are large, their difference would be as large again.
    square, total, product, powers = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros((2, *size))
    for done, (i, k) in enumerate(bands):
        progress.report("compare bands", done, len(bands))
        a, b = first[i].astype(np.float64), second[k].astype(np.float64)
        square += (b - a) ** 2
        total += b - a
        product += a * b
        powers += (a**2, b**2)
    known = np.isfinite(square)
    if not known.any():
        return depth
    norm = np.sqrt(powers[0, known] * powers[1, known])
    cosine = np.divide(product[known], norm, out=np.zeros_like(norm), where=norm > 0)
    return ResultDifference(
        depth.pixels,
        depth.share,
        depth.depth_rms_mm,
        depth.depth_bias_mm,
        depth.depth_median_abs_mm,
        len(bands),
        float(np.sqrt(square[known].mean() / len(bands))),
        float(total[known].mean() / len(bands)),
        float(np.arccos(cosine.clip(-1, 1)).mean()),
    )


def difference_table(found: ResultDifference) -> tuple[Verdict, ...]:
    """The figures as rows of a table."""
    rows = [
        Verdict("Pixels that both have", f"{100 * found.share:.2f}", "%"),
        Verdict("Depth, RMS difference", f"{found.depth_rms_mm:.3f}", "mm"),
        Verdict("Depth, mean difference", f"{found.depth_bias_mm:+.3f}", "mm"),
        Verdict("Depth, median of absolute difference", f"{found.depth_median_abs_mm:.3f}", "mm"),
    ]
    if found.reflectance_rms is not None:
        rows += [
            Verdict("Reflectance, RMS difference", f"{found.reflectance_rms:.4f}"),
            Verdict("Reflectance, mean difference", f"{found.reflectance_bias:+.4f}"),
            Verdict("Mean spectral angle", f"{found.mean_angle_rad:.4f}", "rad"),
            Verdict("Common bands", str(found.bands)),
        ]
    return tuple(rows)
