"""The plane of a flat target from depths of single pixels, each known to a projector column only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.shading import Plane
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Pixels farther from the plane than this many robust deviations, or relative to their depth, are not on it.
OUTLIER_SIGMAS, LEAST_RELATIVE = 4.0, 0.012
ROUNDS = 8
MIN_PIXELS = 200
#: Planes through three pixels that the start is chosen from, and pixels that each is judged by.
TRIALS, JUDGES = 200, 2000
#: Half of what a bulge is stated over, mm, and parts along each side of the picture, left out in turn.
HALF_SPAN_MM, PARTS = 150.0, 4
#: A bulge is none within so many of its deviations.
BULGE_SIGMAS = 4.0
#: Pixels must spread this much across their longest extent, relative to it.
LEAST_WIDTH = 0.02


@dataclass(frozen=True)
class TargetPlane:
    """A plane, the pixels on it (rows, columns) and the rms of their depths about it, mm."""

    plane: Plane
    on_plane: Mask
    rms_mm: float


def fit_plane(rig: Rig, depth_mm: Floats, usable: Mask, start: Mask | None = None) -> TargetPlane:
    """The plane through most of the depths (rows, columns); ``start`` marks pixels that are certainly on it.

    A plane's inverse depth is affine in the image coordinates, and inverse depth is nearly linear in the
    projector column, so that the rounding of columns averages out without a bias. Up to half of the pixels
    may be elsewhere. Raises `CalibrationError` when too few pixels agree.
    """
    rays = pixel_rays(rig.camera)
    usable = usable & np.isfinite(depth_mm)
    inverse = 1 / np.where(usable, depth_mm, 1.0)
    on_plane = usable if start is None else usable & start
    _require_pixels(rays, on_plane)
    on_plane = on_plane & _near_first_plane(rays, inverse, on_plane)
    for _ in range(ROUNDS):
        _require_pixels(rays, on_plane)
        plane = Plane(_least_squares(rays[:, on_plane], inverse[on_plane]))
        miss = np.tensordot(plane.inverse, rays, 1) / inverse - 1
        spread = float(robust_std(miss[on_plane]))
        before = on_plane
        on_plane = usable & (np.abs(miss) < max(OUTLIER_SIGMAS * spread, LEAST_RELATIVE))
        if (on_plane == before).all():
            break
    off = (miss * depth_mm)[on_plane]
    return TargetPlane(plane, on_plane, float(np.sqrt(np.mean(off**2))))


def bulge_mm(rig: Rig, depth_mm: Floats, found: TargetPlane) -> tuple[float, float]:
    """How far a target bulges towards the camera over 300 mm, and its deviation (mm), by depths of pixels.

    A paraboloid is fitted to the distances from the plane. What lenses and rounded columns leave differs from
    part to part of the picture, so that leaving out one after the other says how well it is known.
    """
    rays = pixel_rays(rig.camera)[:, found.on_plane]
    points = rays * depth_mm[found.on_plane]
    size = np.linalg.norm(found.plane.inverse)
    height = (1 - found.plane.inverse @ points) / size
    along = points - (found.plane.inverse / size)[:, None] * (found.plane.inverse @ points / size)
    along = (along - along.mean(1, keepdims=True)) / HALF_SPAN_MM
    terms = np.stack([np.ones(len(height)), along[0], along[1], -(along**2).sum(0)])
    rows, columns = np.nonzero(found.on_plane)
    part = rows * PARTS // depth_mm.shape[0] * PARTS + columns * PARTS // depth_mm.shape[1]
    normal, right = np.zeros((PARTS**2, 4, 4)), np.zeros((PARTS**2, 4))
    for k in range(PARTS**2):
        mine = terms[:, part == k]
        normal[k], right[k] = mine @ mine.T, mine @ height[part == k]
    full_normal, full_right = normal.sum(0), right.sum(0)
    value = float(np.linalg.solve(full_normal, full_right)[3])
    used = np.bincount(part, minlength=PARTS**2) > 0
    left_out = np.linalg.solve(full_normal - normal[used], (full_right - right[used])[..., None])[:, 3, 0]
    return value, float(np.sqrt((len(left_out) - 1) * np.mean((left_out - value) ** 2)))


def bulge_figure(name: str, bulge: tuple[float, float] | None, most_mm: float) -> tuple[Figure, ...]:
    """A bulge and its deviation (mm), against limits of ``most_mm`` or some deviations, the larger.

    No figure where it was not measured.
    """
    if bulge is None:
        return ()
    value, std = bulge
    limit = max(most_mm, BULGE_SIGMAS * std)
    return (
        Figure(
            name=name,
            value=value,
            unit="mm",
            std=std,
            low=-limit,
            high=limit,
            advice="Use a flat target, as its sides are lit from other angles than the fit assumes. If it is"
            " flat, calibrate the geometry again.",
        ),
    )


def _near_first_plane(rays: Floats, inverse: Floats, on_plane: Mask) -> Mask:
    """Pixels near the plane through three of them that half of all are nearest to.

    Least median of squares (Rousseeuw 1984): a plane through all pixels at once is drawn to what stands in a
    corner, and then keeps it.
    """
    chosen = np.flatnonzero(on_plane)
    rng = np.random.default_rng(0)
    judges = rng.choice(chosen, min(JUDGES, len(chosen)), replace=False)
    seen, value = rays.reshape(3, -1)[:, judges], inverse.ravel()[judges]
    corners = rng.integers(0, len(judges), (TRIALS, 3))
    matrices = seen.T[corners]
    # Three pixels on a line determine no plane.
    sound = np.abs(np.linalg.det(matrices)) > 1e-6 * np.ptp(seen[0]) * np.ptp(seen[1])
    planes = np.linalg.solve(matrices[sound], value[corners[sound]][..., None])[..., 0]
    middle = np.median(np.abs(planes @ seen / value - 1), 1)
    best = int(middle.argmin())
    miss = np.tensordot(planes[best], rays, 1) / inverse - 1
    return np.asarray(
        np.abs(miss) < max(OUTLIER_SIGMAS * STD_OF_MEDIAN_SIZE * float(middle[best]), LEAST_RELATIVE)
    )


def _require_pixels(rays: Floats, on_plane: Mask) -> None:
    """Raise `CalibrationError` where pixels are few, or form a line, which many planes contain."""
    if on_plane.sum() < MIN_PIXELS:
        raise CalibrationError(
            f"Only {int(on_plane.sum())} pixels are on one plane. Check that a flat target fills the"
            " middle of the picture, that the projector lights it, and that the code is readable."
        )
    narrow, wide = np.linalg.eigvalsh(np.cov(rays[:2, on_plane]))
    if narrow < LEAST_WIDTH**2 * wide:
        raise CalibrationError(
            "The pixels on the plane form a line, which does not determine its tilt."
            " Check that the flat target fills the middle of the picture and that the projector lights it."
        )


def _least_squares(rays: Floats, inverse: Floats) -> Floats:
    """Coefficients (3,) of inverse depth over rays (3, pixels)."""
    return np.asarray(np.linalg.solve(rays @ rays.T, rays @ inverse))
