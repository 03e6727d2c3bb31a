"""What the points of a result say about shape: a plane through a region, a section along a line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.grid_mesh import are_joined
from dsl_core.solve.normal import BAND_95
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float32] | NDArray[np.float64]

#: Residuals beyond this many robust deviations are weighted down (J. W. Tukey's biweight).
TUKEY = 4.685
#: Rounds of weighting, which settle long before.
ROUNDS = 20


@dataclass(frozen=True)
class PlaneFit:
    """A plane ``normal . point = offset_mm`` in camera coordinates, its normal towards the camera.

    ``rms_mm`` and ``range_mm`` are the root mean square and the range of the distances of the points that
    were used, ``expected_mm`` the root mean square that their stated deviations promise, and ``tilt_deg`` the
    angle between the normal and the camera's axis with its deviation. ``used`` of ``points`` were not too far
    off to count.
    """

    normal: NDArray[np.float64]
    offset_mm: float
    rms_mm: float
    range_mm: float
    expected_mm: float
    tilt_deg: float
    tilt_std_deg: float
    points: int
    used: int


def fit_plane(points_mm: Floats, depth_std_mm: Floats | None = None) -> PlaneFit | None:
    """The plane through points (n, 3), weighted by the deviation of their depths; None for fewer than four.

    Points without a deviation are left out, unless fewer than four have one: then it is known of none.

    Depth errs along the ray of a pixel. Along a ray a plane's inverse depth is affine in the ray, ``1/z =
    (n . ray) / d``, so that the fit is linear in what is uncertain. Points off the plane by far more than
    others count less.
    """
    points = np.asarray(points_mm, np.float64)
    std = None if depth_std_mm is None else np.asarray(depth_std_mm, np.float64)
    known = there = np.isfinite(points).all(1)
    if std is not None:
        known = there & np.isfinite(std) & (std > 0)
        if known.sum() < 4:
            std, known = None, there
    points = points[known]
    if len(points) < 4:
        return None
    z = points[:, 2]
    rays, inverse = points / z[:, None], 1 / z
    spread = (np.ones(len(z)) if std is None else std[known]) * inverse**2
    found = _inverse_plane(rays, inverse, spread)
    if found is None:
        return None
    solution, covariance, residual, used = found
    length = float(np.linalg.norm(solution))
    # 1/z = solution . ray, so solution . point = 1; the normal shall point against the rays.
    normal = -solution / length
    off = (points @ normal + 1 / length)[used]
    expected = float("nan")
    if std is not None:
        expected = float(np.sqrt(np.mean((std[known][used] * (rays[used] @ normal)) ** 2)))
    # What is not flat within the deviations bounds how well a tilt is known, too.
    noise = max(float(np.mean(residual[used] ** 2)), 0.0 if std is None else 1.0)
    tilt_deg, tilt_std_deg = _tilt(normal, noise * covariance / length**2)
    return PlaneFit(
        normal=normal,
        offset_mm=-1 / length,
        rms_mm=float(np.sqrt(np.mean(off**2))),
        range_mm=float(np.ptp(off)),
        expected_mm=expected,
        tilt_deg=tilt_deg,
        tilt_std_deg=tilt_std_deg,
        points=len(points),
        used=int(used.sum()),
    )


def _inverse_plane(
    rays: NDArray[np.float64], inverse: NDArray[np.float64], spread: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]] | None:
    """``p`` (3,) of ``p . ray = 1/z`` for rays (n, 3), inverse depths (n,) and their deviations (n,).

    With its covariance (3, 3) for deviations as stated, the residuals (n,) in deviations, and which points
    count (n,). None where the points do not tell a plane.
    """
    weights: NDArray[np.float64] = np.ones(len(inverse))
    solution: NDArray[np.float64] = np.zeros(3)
    for _ in range(ROUNDS):
        scaled = rays * (np.sqrt(weights) / spread)[:, None]
        normal_matrix = scaled.T @ scaled
        if np.linalg.cond(normal_matrix) > 1e14:
            return None
        covariance = np.asarray(np.linalg.inv(normal_matrix), np.float64)
        last, solution = solution, covariance @ (scaled.T @ (inverse * np.sqrt(weights) / spread))
        residual = (rays @ solution - inverse) / spread
        limit = TUKEY * max(float(robust_std(residual)), 1e-12)
        weights = np.maximum(1 - (residual / limit) ** 2, 0) ** 2
        if np.allclose(last, solution, rtol=1e-10):
            break
    return solution, covariance, residual, weights > 0


def _tilt(normal: NDArray[np.float64], covariance: NDArray[np.float64]) -> tuple[float, float]:
    """Angle of a unit normal (3,) with its covariance (3, 3) to the camera's axis, and its deviation, deg.

    What is across the direction of the tilt adds to it only while that direction is unknown: noise alone
    tilts a plane that faces the camera by both components, and an angle is never below zero.
    """
    tilt = float(np.arccos(np.clip(-normal[2], -1, 1)))
    towards = np.array([0.0, 0.0, -1.0]) - normal * -normal[2]
    size = float(np.linalg.norm(towards))
    if size < 1e-9:
        towards, size = np.array([1.0, 0.0, 0.0]), 1.0
    towards /= size
    across = np.cross(normal, towards)
    along_variance, across_variance = (float(each @ covariance @ each) for each in (towards, across))
    within = across_variance / max(across_variance + (tilt / BAND_95) ** 2, 1e-30)
    return float(np.degrees(tilt)), float(np.degrees(np.sqrt(along_variance + within * across_variance)))


@dataclass(frozen=True)
class Section:
    """A cut between two pixels, in the plane through both points and the camera; arrays of (samples,).

    ``along_mm`` runs along the straight line between the two points, from 0 to its length; ``height_mm`` is
    how far the surface is from that line, towards the camera; ``std_mm`` the deviation of that height by the
    deviations of depth, those of the two points among them. NaN where the surface has no point, or where one
    of these deviations is not known.
    """

    along_mm: NDArray[np.float64]
    height_mm: NDArray[np.float64]
    std_mm: NDArray[np.float64]


def section(
    points_mm: Floats, depth_std_mm: Floats | None, first: tuple[int, int], last: tuple[int, int]
) -> Section | None:
    """The cut of points (3, rows, columns) between two pixels (x, y); None where one of them has no point.

    All pixels on the straight line between the two in the image are in one plane with the camera, so the
    cut is exact. Between two pixels next to the line, points are interpolated along the image.
    """
    ends = [np.asarray(points_mm[:, y, x], np.float64) for x, y in (first, last)]
    base = ends[1] - ends[0]
    length = float(np.linalg.norm(base))
    if not np.isfinite(length) or length == 0:
        return None
    count = max(abs(last[0] - first[0]), abs(last[1] - first[1])) + 1
    x, y = (np.linspace(a, b, count) for a, b in zip(first, last, strict=True))
    points, std = _on_line(points_mm, depth_std_mm, x, y)
    along = base / length
    across = -ends[0] + (ends[0] @ along) * along
    size = float(np.linalg.norm(across))
    if size < 1e-9:
        return None
    across /= size
    moved = points - ends[0][:, None]
    rays = points / points[2]
    own = np.abs(across @ rays) * std
    return Section(along @ moved, across @ moved, _with_ends(own, along @ moved / length))


def _with_ends(own: NDArray[np.float64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Deviations (samples,) of heights over a line between two points that are uncertain themselves.

    ``own`` are those of the points alone, ``share`` how far along the line each is. The ends are on it.
    """
    first, last = own[[0, -1]]
    total = np.asarray(np.sqrt(own**2 + ((1 - share) * first) ** 2 + (share * last) ** 2))
    total[[0, -1]] = np.where(np.isfinite(own[[0, -1]]), 0.0, np.nan)
    return total


def _on_line(
    points: Floats, std: Floats | None, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (3, samples) and deviations (samples,) at places of the image, one of them whole numbers."""
    left, top = np.floor(x + 1e-9).astype(int), np.floor(y + 1e-9).astype(int)
    share = np.clip(x - left + y - top, 0, 1)
    right = np.minimum(left + (x - left > 1e-6), points.shape[2] - 1)
    below = np.minimum(top + (y - top > 1e-6), points.shape[1] - 1)
    one, other = (np.asarray(points[:, *at], np.float64) for at in ((top, left), (below, right)))
    a, b = (
        np.full(len(x), np.nan) if std is None else np.asarray(std[at], np.float64)
        for at in ((top, left), (below, right))
    )
    # Where the surface does not go on from one to the other, nothing is made up; the nearer one decides.
    mixes = are_joined(one, other, np.hypot(np.nan_to_num(a), np.nan_to_num(b)))
    found = np.where(mixes, one + share * (other - one), np.where(share < 0.5, one, other))
    spread = np.hypot((1 - share) * a, share * b)
    return found, np.where(mixes & np.isfinite(spread), spread, np.where(share < 0.5, a, b))
