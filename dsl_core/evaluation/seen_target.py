"""A flat target as one result saw it: its plane, the pixels about it, and how sure its distance is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.evaluation.depth import PlaneFit, fit_plane
from dsl_core.model.result import DEPTH_INVALID, Flag
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]
#: A rectangle of the image: x, y, width, height, px.
Region = tuple[int, int, int, int]
#: Rows and columns of patches, whose means are what the published figure is made of.
PATCHES = (6, 8)
#: Fewer patches do not say how sure the plane is.
MIN_PATCHES = 4
#: Pixels whose depth is coarse or mixed say nothing about how well the others are measured.
DEPTH_LIMITED = DEPTH_INVALID | Flag.NOT_REFINED | Flag.DEPTH_EDGE
#: Farther from the plane than so many robust deviations is not the target: an edge, dust, what stands behind.
_OUTLIER = 4.0
#: No depth is finer than this, mm: rounding must not make outliers.
_ROUNDING_MM = 1e-3
_ROUNDS = 12
#: The first search of the plane looks at about so many pixels along each side.
_THIN_PX = 150


@dataclass(frozen=True)
class SeenTarget:
    """The plane of a target and how pixels lie about it.

    ``left_out`` pixels of the region have a depth but are limited or lie off the plane. ``residual_mm``
    (h, w) is how far behind the plane a pixel lies, NaN where it is not counted. ``patches_mm`` are mean
    depths of patches in their grid, NaN where most of a patch is missing; ``centres_mm`` (2, n) and
    ``patch_residuals_mm`` (n,) belong to those that are there.
    """

    plane: PlaneFit
    left_out: int
    residual_mm: Floats
    patches_mm: Floats
    centres_mm: Floats
    patch_residuals_mm: Floats

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        height, width = self.residual_mm.shape
        return int(height), int(width)

    @property
    def middle_mm(self) -> tuple[float, float]:
        """The middle of the target, across the camera's axis."""
        x, y = self.centres_mm.mean(axis=1)
        return float(x), float(y)

    def depth_at(self, x_mm: float, y_mm: float) -> tuple[float, float]:
        """Depth of the plane next to the camera's axis, and its standard deviation, mm.

        The deviation follows from how far the means of patches lie off the plane; an error that the whole
        plane has, such as one of the calibration, is not in it.
        """
        x, y, z = self.plane.normal
        depth = (self.plane.offset_mm - x * x_mm - y * y_mm) / z
        off = self.patch_residuals_mm
        across, down = self.centres_mm
        sides = np.stack([np.ones_like(across), across - x_mm, down - y_mm], axis=1)
        variance = float(off @ off) / (len(off) - 3)
        return float(depth), float(np.sqrt(variance * np.linalg.pinv(sides.T @ sides)[0, 0]))


def find_target(
    points_mm: Floats, flags: NDArray[np.integer] | None = None, region: Region | None = None
) -> SeenTarget:
    """Find the plane of a flat target among points (3, h, w) of an image or a region of it.

    Limited pixels are not counted, nor what lies off the plane. Raises `DecodeError` when the region lies
    outside the image or holds too few depths.
    """
    rows, columns = _cut(points_mm.shape[1:], region)
    inside = points_mm[:, rows, columns].astype(np.float64)
    measured: Mask = np.asarray(np.isfinite(inside).all(axis=0))
    chosen = measured.copy()
    if flags is not None:
        chosen &= (flags[rows, columns] & int(DEPTH_LIMITED)) == 0
    _require_pixels(chosen, measured)
    plane, kept = _plane(inside, chosen)
    behind = _behind(plane, inside)
    grid, centres, off = _patches(inside, np.where(kept, behind, np.nan))
    if off.size < MIN_PATCHES:
        raise DecodeError(
            f"The flat target is visible in {off.size} of {grid.size} patches, and {MIN_PATCHES} are needed."
            " Choose a region that it fills."
        )
    residual = np.full(points_mm.shape[1:], np.nan, np.float32)
    residual[rows, columns] = np.where(kept, behind, np.nan)
    return SeenTarget(plane, int(measured.sum() - kept.sum()), residual, grid, centres, off)


def _cut(shape: tuple[int, ...], region: Region | None) -> tuple[slice, slice]:
    if region is None:
        return slice(0, shape[0]), slice(0, shape[1])
    x, y, width, height = region
    if min(x, y) < 0 or min(width, height) < 1 or x + width > shape[1] or y + height > shape[0]:
        raise DecodeError(
            f"The region {width} x {height} px at column {x}, row {y} is not inside the picture of"
            f" {shape[1]} x {shape[0]} px. Choose one inside it."
        )
    return slice(y, y + height), slice(x, x + width)


def _require_pixels(chosen: Mask, measured: Mask) -> None:
    if not measured.any():
        raise DecodeError("It has no depth there. Choose another result, or another region.")
    if not chosen.any():
        raise DecodeError(
            f"All {int(measured.sum())} pixels with a depth are limited: coarse, or next to an edge. Scan"
            " with more lines, or choose another region."
        )


def _plane(points: Floats, chosen: Mask) -> tuple[PlaneFit, Mask]:
    """The plane of most of the pixels, and those that lie on it."""
    plane = _plane_of_most(points, chosen)
    kept = chosen
    for _ in range(_ROUNDS):
        off = np.abs(_behind(plane, points))
        limit = _OUTLIER * max(float(robust_std(off[chosen])), _ROUNDING_MM)
        now = chosen & (off <= limit)
        plane = fit_plane(points, now)
        if bool((now == kept).all()):
            break
        kept = now
    return plane, now


def _plane_of_most(points: Floats, chosen: Mask) -> PlaneFit:
    """The plane of that half of the pixels that lies nearest to it, of a thinned image.

    A fit to all would be tilted by what stands next to the target.
    """
    step = max(1, min(chosen.shape) // _THIN_PX)
    points, chosen = points[:, ::step, ::step], chosen[::step, ::step]
    plane = fit_plane(points, chosen)
    for _ in range(_ROUNDS):
        off = np.where(chosen, np.abs(_behind(plane, points)), np.inf)
        plane = fit_plane(points, chosen & (off <= np.median(off[chosen])))
    return plane


def _behind(plane: PlaneFit, points: Floats) -> NDArray[np.float64]:
    """How far behind the plane points (3, h, w) lie; its normal is turned towards the camera."""
    return np.asarray(plane.offset_mm - np.tensordot(np.asarray(plane.normal), points, 1), np.float64)


def _patches(points: Floats, behind: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean depths in the grid of patches; middles across the axis and mean residuals of those seen."""
    grid = np.full(PATCHES, np.nan)
    middles, residuals = [], []
    for i, rows in enumerate(np.array_split(np.arange(behind.shape[0]), PATCHES[0])):
        for k, columns in enumerate(np.array_split(np.arange(behind.shape[1]), PATCHES[1])):
            part = np.ix_(rows, columns)
            seen = np.isfinite(behind[part])
            if 2 * int(seen.sum()) <= seen.size:
                continue
            x, y, z = (float(axis[part][seen].mean()) for axis in points)
            grid[i, k] = z
            middles.append((x, y))
            residuals.append(float(behind[part][seen].mean()))
    return grid, np.array(middles).reshape(-1, 2).T, np.array(residuals)
