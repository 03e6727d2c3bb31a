"""Regions of an image: which pixels lie in an outline, and the spectrum they have in common."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Floats = NDArray[np.float32] | NDArray[np.float64]


def mask_of_outline(outline_px: Sequence[tuple[float, float]], shape: tuple[int, int]) -> Mask:
    """Pixels whose centre lies in a closed outline of (x, y) corners, even-odd rule; shape (rows, columns).

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
    """Whether points lie in a closed outline of (x, y) corners, even-odd rule; NaN lies outside."""
    corners = np.asarray(outline, np.float64).reshape(-1, 2)
    inside = np.zeros(np.broadcast_shapes(x.shape, y.shape), bool)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if ay != by:
            crosses = (ay > y) != (by > y)
            inside ^= crosses & (x < (bx - ax) * (y - ay) / (by - ay) + ax)
    return inside


def runs_of(mask: Mask) -> tuple[tuple[int, int, int], ...]:
    """A mask (rows, columns) as runs of (row, first column, columns), to be kept in a file."""
    edges = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    starts, stops = np.argwhere(edges == 1), np.argwhere(edges == -1)
    return tuple((int(y), int(x), int(end - x)) for (y, x), (_, end) in zip(starts, stops, strict=True))


def mask_of_runs(runs: Iterable[tuple[int, int, int]], shape: tuple[int, int]) -> Mask:
    """The mask of `runs_of`; what lies outside the image is left out."""
    mask = np.zeros(shape, bool)
    for y, x, count in runs:
        if 0 <= y < shape[0]:
            mask[y, max(x, 0) : max(x + count, 0)] = True
    return mask


@dataclass(frozen=True)
class RegionSpectrum:
    """Mean reflectance of a region and the deviation of its pixels, of shape (bands,); NaN without pixels.

    ``pixels`` lie in the outline, ``used`` of them have a spectrum. ``pixel_std`` is the mean uncertainty
    stated for a single pixel; a deviation far above it means that the region is not of one material.
    """

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    pixel_std: NDArray[np.float64]
    data_share: NDArray[np.float64]
    pixels: int
    used: int


def region_spectrum(reflectance: Floats, std: Floats, data_share: Floats, mask: Mask) -> RegionSpectrum:
    """The spectrum of the pixels of a mask (rows, columns) in band-first cubes (bands, rows, columns)."""
    at = np.flatnonzero(mask)
    # Band by band, so that no copy of a cube is made.
    solid = at[np.isfinite(reflectance.reshape(len(reflectance), -1)[len(reflectance) // 2][at])]
    if solid.size == 0:
        nothing = np.full(len(reflectance), np.nan)
        return RegionSpectrum(nothing, nothing, nothing, nothing, int(at.size), 0)
    picked, spread, share = (
        cube.reshape(len(cube), -1)[:, solid].astype(np.float64) for cube in (reflectance, std, data_share)
    )
    return RegionSpectrum(
        mean=np.nanmean(picked, axis=1),
        deviation=np.nanstd(picked, axis=1, ddof=1) if solid.size > 1 else np.zeros(len(picked)),
        pixel_std=np.nanmean(spread, axis=1),
        data_share=np.nanmean(share, axis=1),
        pixels=int(at.size),
        used=int(solid.size),
    )
