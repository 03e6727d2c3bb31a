"""What a pixel, two points and a region of a result say: reasons, a distance, a spectrum."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.evaluation.uncertainty import DECIDED_FROM
from dsl_core.model.result import REASONS, Flag

Mask = NDArray[np.bool_]
Floats = NDArray[np.float32] | NDArray[np.float64]
#: Noise of neighbouring pixels hangs together over about this many of them.
_PIXELS_TOGETHER = 9
#: The part of a pixel's variance that no number of pixels averages out, because all have it in common.
_IN_COMMON = 0.05
#: Of fifty bands one is so many deviations off by chance in one of three hundred pairs.
SHOWN_FROM = 4.0


def mask_of_outline(outline_px: Sequence[tuple[float, float]], shape: tuple[int, int]) -> Mask:
    """Pixels whose centre is in a closed outline of (x, y) corners, even-odd rule; shape (rows, columns).

    Pixel (x, y) has its centre at (x, y), so a rectangle from -0.5 to 9.5 holds ten columns.
    """
    rows, columns = shape
    mask = np.zeros(shape, bool)
    corners = np.asarray(outline_px, np.float64).reshape(-1, 2)
    if len(corners) < 3:
        return mask
    (x0, y0), (x1, y1) = corners.min(0), corners.max(0)
    top, bottom = max(int(np.ceil(y0)), 0), min(int(np.floor(y1)), rows - 1)
    left, right = max(int(np.ceil(x0)), 0), min(int(np.floor(x1)), columns - 1)
    if top > bottom or left > right:
        return mask
    x, y = np.arange(left, right + 1)[None, :], np.arange(top, bottom + 1)[:, None]
    mask[top : bottom + 1, left : right + 1] = inside_outline(x, y, corners)
    return mask


def inside_outline(
    x: NDArray[Any], y: NDArray[Any], outline: NDArray[np.float64] | Sequence[tuple[float, float]]
) -> Mask:
    """Whether points are in a closed outline of (x, y) corners, even-odd rule; NaN is outside."""
    corners = np.asarray(outline, np.float64).reshape(-1, 2)
    inside = np.zeros(np.broadcast_shapes(x.shape, y.shape), bool)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if ay != by:
            crosses = (ay > y) != (by > y)
            # Far from an edge that is nearly level the share overflows, but there nothing crosses.
            with np.errstate(over="ignore", invalid="ignore"):
                inside ^= crosses & (x < (bx - ax) * ((y - ay) / (by - ay)) + ax)
    return inside


def runs_of(mask: Mask) -> tuple[tuple[int, int, int], ...]:
    """A mask (rows, columns) as runs of (row, first column, columns), to be kept in a file."""
    edges = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    starts, stops = np.argwhere(edges == 1), np.argwhere(edges == -1)
    return tuple((int(y), int(x), int(end - x)) for (y, x), (_, end) in zip(starts, stops, strict=True))


def mask_of_runs(runs: Iterable[tuple[int, int, int]], shape: tuple[int, int]) -> Mask:
    """The mask of `runs_of`; what is outside the image is left out."""
    mask = np.zeros(shape, bool)
    for y, x, count in runs:
        if 0 <= y < shape[0]:
            mask[y, max(x, 0) : max(x + count, 0)] = True
    return mask


def left_of_variance(pixels: int) -> float:
    """The share of a pixel's variance that is left in the mean of so many that are next to each other.

    >>> left_of_variance(1), left_of_variance(36), left_of_variance(10_000)
    (1.0, 0.25, 0.05)
    """
    return max(min(_PIXELS_TOGETHER / pixels, 1.0), _IN_COMMON)


@dataclass(frozen=True)
class RegionSpectrum:
    """Mean reflectance of a region and the deviation of its pixels, of shape (bands,); NaN without pixels.

    ``pixels`` are in the outline, ``used`` of them have a spectrum, of which bands may be missing (NaN).
    ``pixel_std`` is the mean uncertainty stated for a single pixel; a deviation far above it means that the
    region is not of one material. A single pixel has no ``deviation`` (NaN).
    """

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    pixel_std: NDArray[np.float64]
    data_share: NDArray[np.float64]
    pixels: int
    used: int

    @property
    def spread(self) -> NDArray[np.float64]:
        """How its pixels differ, (bands,); of a single pixel, the deviation stated for it."""
        return self.pixel_std if self.used == 1 else self.deviation

    @property
    def mean_std(self) -> NDArray[np.float64]:
        """What the mean is uncertain by, (bands,), as stated deviations hang together from pixel to pixel."""
        return np.asarray(self.pixel_std * np.sqrt(left_of_variance(max(self.used, 1))))


def region_spectrum(reflectance: Floats, std: Floats, data_share: Floats, mask: Mask) -> RegionSpectrum:
    """The spectrum of the pixels of a mask (rows, columns) in band-first cubes (bands, rows, columns)."""
    at = np.flatnonzero(mask)
    # Band by band, so that no copy of a cube is made.
    is_known = np.zeros(at.size, bool)
    for band in reflectance.reshape(len(reflectance), -1):
        is_known |= np.isfinite(band[at])
    solid = at[is_known]
    if solid.size == 0:
        nothing = np.full(len(reflectance), np.nan)
        return RegionSpectrum(nothing, nothing, nothing, nothing, int(at.size), 0)
    picked, spread, share = (
        cube.reshape(len(cube), -1)[:, solid].astype(np.float64) for cube in (reflectance, std, data_share)
    )
    return RegionSpectrum(
        mean=_over_pixels(np.nanmean, picked),
        deviation=_over_pixels(partial(np.nanstd, ddof=1), picked, least=2),
        pixel_std=_over_pixels(np.nanmean, spread),
        data_share=_over_pixels(np.nanmean, share),
        pixels=int(at.size),
        used=int(solid.size),
    )


def _over_pixels(
    figure: Callable[..., Any], values: NDArray[np.float64], least: int = 1
) -> NDArray[np.float64]:
    """A figure (bands,) of values (bands, pixels); NaN for bands that fewer pixels than ``least`` have."""
    is_known = np.isfinite(values)
    enough = is_known.sum(axis=1) >= least
    found = np.full(len(values), np.nan)
    found[enough] = figure(np.where(is_known, values, np.nan)[enough], axis=1)
    return found


def explain_pixel(
    flags: int,
    wavelengths_nm: NDArray[np.float64],
    data_share: NDArray[np.floating] | None = None,
    depth_std_mm: float | None = None,
) -> list[str]:
    """Sentences on every flag of a pixel, with the bands or deviations that belong to it; empty when good."""
    sentences = []
    for flag, reason in REASONS.items():
        if not flags & flag:
            continue
        if flag is Flag.BANDS_UNREACHED and data_share is not None:
            ranges = undecided_ranges(wavelengths_nm, data_share)
            reason = f"{reason}: {ranges}" if ranges else reason
        if flag is Flag.NOT_REFINED and depth_std_mm is not None and np.isfinite(depth_std_mm):
            reason = f"{reason} (±{depth_std_mm:.2g} mm)"
        sentences.append(reason)
    return sentences


def undecided_ranges(wavelengths_nm: NDArray[np.float64], data_share: NDArray[np.floating]) -> str:
    """Where the prior decides, as text such as ``430–445 nm, 655–660 nm``."""
    with np.errstate(invalid="ignore"):
        undecided = np.asarray(data_share) < DECIDED_FROM
    parts = []
    for _, first, count in runs_of(undecided[None]):
        low, high = wavelengths_nm[first], wavelengths_nm[first + count - 1]
        parts.append(f"{low:g} nm" if count == 1 else f"{low:g}–{high:g} nm")
    return ", ".join(parts)


@dataclass(frozen=True)
class Distance:
    """The straight distance between two points and its standard deviation, mm."""

    mm: float
    std_mm: float


def distance_between(a_mm: Floats, b_mm: Floats, a_std_mm: float = 0.0, b_std_mm: float = 0.0) -> Distance:
    """Distance of two points (3,) in camera coordinates; ``std`` are those of their depths.

    A wrong depth moves a point along its ray, of which only the part along the connection counts; errors of
    the two depths are taken as independent. NaN where a point is.
    """
    a, b = np.asarray(a_mm, np.float64), np.asarray(b_mm, np.float64)
    between = b - a
    length = float(np.linalg.norm(between))
    if length == 0.0:
        return Distance(0.0, float(np.hypot(a_std_mm, b_std_mm)))
    along = between / length
    shift_a, shift_b = a_std_mm * along @ (a / a[2]), b_std_mm * along @ (b / b[2])
    return Distance(length, float(np.hypot(shift_a, shift_b)))


@dataclass(frozen=True)
class Difference:
    """Where two spectra differ most for their deviations: difference of reflectance, its deviation, nm."""

    value: float
    std: float
    nm: float

    @property
    def is_shown(self) -> bool:
        """Whether it is more than deviations of this many bands make by chance."""
        return abs(self.value) > SHOWN_FROM * self.std


def largest_difference(nm: Floats, a: Floats, b: Floats, a_std: Floats, b_std: Floats) -> Difference | None:
    """The band (bands,) in which ``a - b`` is the most deviations from zero; None where none is known.

    Errors of both are taken as independent: what two marks have in common makes them no less alike.
    """
    difference, std = np.asarray(a, np.float64) - b, np.hypot(a_std, b_std)
    known = np.flatnonzero(np.isfinite(difference) & (std > 0))
    if known.size == 0:
        return None
    most = known[np.argmax(np.abs(difference[known]) / std[known])]
    return Difference(float(difference[most]), float(std[most]), float(nm[most]))


def on_screen(points_mm: Floats, projection: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalised screen coordinates and depth (n, 3) of points (n, 3) by a 4 x 4 view and projection matrix.

    x and y run from -1 to 1 over the screen; a point behind the eye is NaN.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        clip = points_mm @ projection[:, :3].T + projection[:, 3]
        return np.asarray(np.where(clip[:, 3:] > 0, clip[:, :3] / clip[:, 3:], np.nan))


def nearest_on_screen(
    seen: NDArray[np.float64], at: tuple[float, float], size_px: tuple[int, int], within_px: float = 6.0
) -> int | None:
    """Index of the point of `on_screen` that is meant by pointing at ``at`` (normalised).

    Of the points within a few pixels it is the foremost; None where there is none.
    """
    dx = (seen[:, 0] - at[0]) * size_px[0] / 2
    dy = (seen[:, 1] - at[1]) * size_px[1] / 2
    near = np.flatnonzero(dx * dx + dy * dy < within_px**2)
    return None if near.size == 0 else int(near[np.argmin(seen[near, 2])])
