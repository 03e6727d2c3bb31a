"""Normals and shading from a depth map.

A plane's inverse depth is affine in the normalised image coordinates, ``1/z = (n . ray) / d``, so a
weighted plane fit in a window is a 3 x 3 system of box-filtered sums.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.sensor import relative_gain

Map = NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """Normals (3, rows, columns), their deviation (rad), shading with relative deviation, and depth edges."""

    normals: Map
    normal_std_rad: Map
    shading: Map
    shading_rel_std: Map
    edge: NDArray[np.bool_]


def default_window_px(rig: Rig) -> int:
    """Window of the plane fits: about 1/45 of the image width, odd, at least 5."""
    return max(5, rig.camera.width_px // 45 | 1)


def reconstruct_surface(rig: Rig, depth_mm: Map, depth_std_mm: Map, window_px: int | None = None) -> Surface:
    """Fit planes around every pixel with a depth (NaN elsewhere) and derive normal and shading."""
    rays = pixel_rays(rig.camera)
    window = window_px or default_window_px(rig)
    valid = np.isfinite(depth_mm)
    inverse = np.where(valid, 1 / np.where(valid, depth_mm, 1), 0.0)
    std = np.where(valid, depth_std_mm, 1.0) * np.where(valid, inverse, 1.0) ** 2
    weight = np.where(valid, 1 / np.maximum(std, 1e-9) ** 2, 0.0)
    weight = weight / (weight.max(initial=0) or 1.0)
    fit, covariance, mean_square, count = _plane_fits(rays, inverse, weight, window)
    fit, covariance, mean_square, count = _best_window(
        rays, inverse, window // 2, fit, covariance, mean_square, count
    )
    noise = np.sqrt(np.maximum(_box(weight * std**2, window), 0) / np.maximum(_box(weight, window), 1e-30))
    normal, spread = _normals(fit, covariance, noise)
    # Curvature bends smooth surfaces away from their tangent plane; a jump is many times that and the noise.
    jump = np.sqrt(np.maximum(mean_square, 0)) > 5 * noise + 0.004 * inverse
    bad = ~valid | (count < max(6, 0.15 * window**2))
    normal[:, bad] = np.nan
    shading, incidence_tan = _shading(rig, rays * np.where(valid, depth_mm, np.nan), normal)
    relative = np.hypot(incidence_tan * spread, 2 * np.where(valid, depth_std_mm * inverse, np.nan))
    return Surface(normal, np.where(bad, np.nan, spread), shading, relative, (jump | bad) & valid)


def _box(values: Map, window: int) -> Map:
    import cv2

    return np.asarray(
        cv2.boxFilter(values, cv2.CV_64F, (window, window), normalize=True, borderType=cv2.BORDER_CONSTANT)
    )


def _plane_fits(rays: Map, inverse: Map, weight: Map, window: int) -> tuple[Map, Map, Map, Map]:
    """Coefficients (3, ...), unit covariance (xx, xy, yy), weighted mean square residual, pixel count."""
    x, y = rays[0], rays[1]
    total = np.maximum(_box(weight, window), 1e-30)

    def mean(values: Map) -> Map:
        return _box(weight * values, window) / total

    # Moments about the window's mean, so that the sums do not cancel.
    mx, my, level = mean(x), mean(y), mean(inverse)
    a, b, c = mean(x * x) - mx * mx, mean(x * y) - mx * my, mean(y * y) - my * my
    rx, ry = mean(x * inverse) - mx * level, mean(y * inverse) - my * level
    determinant = np.maximum(a * c - b * b, 1e-24)
    alpha, beta = (c * rx - b * ry) / determinant, (a * ry - b * rx) / determinant
    residual = mean(inverse**2) - level**2 - alpha * rx - beta * ry
    count = _box((weight > 0).astype(float), window) * window**2
    unit = np.stack([c, -b, a]) / (determinant * np.maximum(count, 1))
    return np.stack([alpha, beta, level - alpha * mx - beta * my]), unit, residual, count


def _best_window(
    rays: Map, inverse: Map, shift: int, fit: Map, unit: Map, residual: Map, count: Map
) -> tuple[Map, Map, Map, Map]:
    """For each pixel the window, centred or next to it, whose plane explains it best (Kuwahara's idea).

    A centred window mixes both sides of a depth jump; one that is on the pixel's own side does not.
    """
    stack = np.concatenate([fit, unit, residual[None], count[None]])
    best = stack.copy()
    enough = 0.5 * count.max(initial=1)

    def cost(maps: Map) -> Map:
        miss = maps[0] * rays[0] + maps[1] * rays[1] + maps[2] - inverse
        return np.where(maps[7] >= enough, miss**2 + np.maximum(maps[6], 0), np.inf)

    # A window next to the pixel must be clearly better: noise alone should not choose it.
    lowest = 0.5 * cost(stack)
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        moved = _moved(stack, dy * shift, dx * shift)
        here = cost(moved)
        better = here < lowest
        lowest = np.where(better, here, lowest)
        best[:, better] = moved[:, better]
    return best[:3], best[3:6], best[6], best[7]


def _moved(stack: Map, down: int, right: int) -> Map:
    """Maps shifted by whole pixels; windows from beyond the image count no pixels."""
    moved = np.roll(stack, (down, right), axis=(1, 2))
    count = moved[-1]
    if down:
        count[slice(0, down) if down > 0 else slice(down, None)] = 0
    if right:
        count[:, slice(0, right) if right > 0 else slice(right, None)] = 0
    return moved


def _normals(fit: Map, unit: Map, noise: Map) -> tuple[Map, Map]:
    """Unit normals towards the camera and a standard deviation (rad) from the fit's covariance."""
    length = np.maximum(np.linalg.norm(fit, axis=0), 1e-12)
    normals = -fit / length
    return normals, noise * np.sqrt(np.maximum(np.maximum(unit[0], unit[2]), 0)) / length


def _shading(rig: Rig, points: Map, normals: Map) -> tuple[Map, Map]:
    """``cos(incidence) (reference / distance)^2`` times the camera's gain; tangent of the incidence."""
    to_light = rig.pose.projector_centre_mm[:, None, None] - points
    distance = np.linalg.norm(to_light, axis=0)
    cosine = (normals * to_light).sum(0) / distance
    safe = np.clip(cosine, 0.05, 1)
    shading = safe * (rig.reference_distance_mm / distance) ** 2 * relative_gain(rig)
    return shading, np.sqrt(1 - safe**2) / safe
