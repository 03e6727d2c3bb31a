"""Pinhole camera with the five-coefficient distortion of Brown and OpenCV.

D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37 (1971); order and signs of the
coefficients are those of OpenCV.

The arithmetic is written with operators only, so that NumPy arrays and torch tensors pass through
the same lines.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.model.geometry import Lens

#: How far beyond the image circle the radial factor still changes (squared radius, unit focal length).
FADE_RADIUS_SQ = 0.3
#: Places along each side of the image where the distortion is inverted to find the image circle.
GRID_POINTS = 17
#: Pixels of a picture whose rays are all kept once they are known.
KEPT_PX = 1 << 20
#: An error from which one more step of Newton's method leaves nothing.
CLOSE = 1e-10
#: Pixels whose rays are sought at once.
BLOCK_PX = 1 << 14


def distort(
    x: Any, y: Any, coefficients: tuple[float, ...], max_radius_sq: float = np.inf
) -> tuple[Any, Any]:
    """Distorted image-plane coordinates of undistorted ones (any shape, unit focal length).

    ``coefficients`` are k1, k2, p1, p2, k3. With ``radial = 1 + k1 r^2 + k2 r^4 + k3 r^6`` the answer is
    ``x radial + 2 p1 x y + p2 (r^2 + 2 x^2)`` and ``y radial + p1 (r^2 + 2 y^2) + 2 p2 x y``. Beyond
    ``max_radius_sq`` the radial factor fades smoothly into a constant, because the polynomial folds back on
    itself far outside the image and would put impossible points inside it.
    """
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    if np.isfinite(max_radius_sq):
        limit = max_radius_sq
        rc = r2.clip(max=limit)
        beyond = r2 - rc
        slope = k1 + limit * (2 * k2 + limit * 3 * k3)
        radial = 1 + rc * (k1 + rc * (k2 + rc * k3)) + slope * beyond / (1 + beyond / FADE_RADIUS_SQ)
    else:
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    xy = 2 * x * y
    return x * radial + p1 * xy + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + p2 * xy


def undistort(
    x: NDArray[np.float64], y: NDArray[np.float64], coefficients: tuple[float, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Undistorted coordinates of distorted ones, same shape: the inverse of `distort` by Newton's method.

    Raises `CalibrationError` when the distortion cannot be inverted there.
    """
    u, v = x.astype(float), y.astype(float)
    h = 1e-6
    for _ in range(20):
        fx, fy = distort(u, v, coefficients)
        ex, ey = fx - x, fy - y
        close = max(np.abs(ex).max(initial=0), np.abs(ey).max(initial=0)) < CLOSE
        ax, ay = distort(u + h, v, coefficients)
        bx, by = distort(u, v + h, coefficients)
        jxx, jyx, jxy, jyy = (ax - fx) / h, (ay - fy) / h, (bx - fx) / h, (by - fy) / h
        det = jxx * jyy - jxy * jyx
        u = u - (jyy * ex - jxy * ey) / det
        v = v - (jxx * ey - jyx * ex) / det
        if close:
            # This step left less than rounding does: a place has one answer, whatever else was asked for.
            return u, v
    if not max(np.abs(ex).max(), np.abs(ey).max()) < 1e-9:
        raise CalibrationError(
            f"The lens distortion ({', '.join(f'{each:.3g}' for each in coefficients)}) cannot be inverted"
            " inside the image; the calibration is not that of a real lens. Calibrate the geometry again:"
            " hold the board near all edges of the picture, and let camera, projector and their lenses be as"
            " they are between poses."
        )
    return u, v


@lru_cache(maxsize=8)
def pixel_rays(lens: Lens) -> NDArray[np.float64]:
    """Direction of every pixel's ray in camera coordinates with z = 1, shape (3, rows, columns)."""
    rays = np.empty((3, lens.height_px, lens.width_px))
    # In blocks that stay in the cache, a third of the time.
    high = max(BLOCK_PX // lens.width_px, 1)
    for top in range(0, lens.height_px, high):
        rows = slice(top, min(top + high, lens.height_px))
        rays[:, rows] = _rays_of(lens, rows)
    rays.setflags(write=False)
    return rays


def rays_in(lens: Lens, rows: slice, columns: slice = slice(None)) -> NDArray[np.float64]:
    """The same of a part of the picture; only those of small pictures are computed once and kept."""
    if lens.width_px * lens.height_px <= KEPT_PX:
        return pixel_rays(lens)[:, rows, columns]
    return _rays_of(lens, rows, columns)


def _rays_of(lens: Lens, rows: slice, columns: slice = slice(None)) -> NDArray[np.float64]:
    across, down = np.meshgrid(
        np.arange(lens.width_px, dtype=np.float64)[columns], np.arange(lens.height_px, dtype=np.float64)[rows]
    )
    return rays_at(lens, across, down)


def rays_at(lens: Lens, columns_px: NDArray[np.float64], rows_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Direction of the rays through places in the image, z = 1, shape (3, ...)."""
    x, y = undistort(
        (columns_px - lens.cx_px) / lens.fx_px, (rows_px - lens.cy_px) / lens.fy_px, lens.distortion
    )
    return np.stack([x, y, np.ones_like(x)])


@lru_cache(maxsize=64)
def max_radius_sq(lens: Lens) -> float:
    """Squared radius of the image circle, a tenth beyond the farthest corner (unit focal length).

    Raises `CalibrationError` when the distortion cannot be inverted inside the image.
    """
    # A coarse grid with all corners: fits ask for another lens at every step.
    columns, rows = np.meshgrid(
        np.linspace(0, lens.width_px - 1, GRID_POINTS), np.linspace(0, lens.height_px - 1, GRID_POINTS)
    )
    corners = rays_at(lens, columns, rows)[:2, [0, 0, -1, -1], [0, -1, 0, -1]]
    return float(1.21 * (corners**2).sum(0).max())


def project(lens: Lens, x: Any, y: Any, z: Any) -> tuple[Any, Any]:
    """Column and row (px) of points in the lens's own coordinates (mm); any shape.

    ``homo^-1(K S)`` of the method's Eq. (11) (Shin et al., CVPR 2024, supplement), with distortion.
    """
    u, v = distort(x / z, y / z, lens.distortion, max_radius_sq(lens))
    return u * lens.fx_px + lens.cx_px, v * lens.fy_px + lens.cy_px
