"""How large what a pixel sees is, so that classes have areas."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Cube = NDArray[np.float32] | NDArray[np.float64]
Map = NDArray[np.float64]

#: A surface seen at a flatter angle than this cosine is not measured by the pixels that see it.
LEAST_COSINE = 0.1


def pixel_areas_mm2(points_mm: Cube, normals: Cube | None = None) -> Map:
    """Area of the surface that each pixel sees, mm2, (rows, columns); NaN without a point.

    ``points_mm`` and ``normals`` are (3, rows, columns) in camera coordinates. The pixel's cone of rays cuts
    ``z^2 J / |n . r|`` out of a plane with normal n: r is the ray with unit depth, J the area between
    neighbouring rays, from a smooth fit to all rays. Triangles between the points themselves would grow with
    the noise of depth. Without a normal the surface is taken to face the camera's axis.
    """
    depth = points_mm[2].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        ray_x, ray_y = points_mm[0] / depth, points_mm[1] / depth
    known = np.isfinite(ray_x) & np.isfinite(ray_y)
    if known.sum() < 3:
        return np.full(depth.shape, np.nan)
    (xx, xy), (yx, yy) = (_gradient(ray, known) for ray in (ray_x, ray_y))
    area = depth**2 * np.abs(xx * yy - xy * yx)
    if normals is None:
        return np.asarray(area)
    cosine = np.abs(normals[0] * ray_x + normals[1] * ray_y + normals[2])
    faces = np.where(np.isfinite(cosine), np.maximum(cosine, LEAST_COSINE), 1.0)
    return np.asarray(area / faces)


def depth_relative_std(points_mm: Cube, depth_std_mm: Cube | None) -> Map | None:
    """Deviation of each pixel's depth as a share of it, (rows, columns); None where it is not stated."""
    if depth_std_mm is None:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(depth_std_mm.astype(np.float64) / points_mm[2])


def _gradient(ray: Map, known: NDArray[np.bool_]) -> tuple[Map, Map]:
    """Change of a ray's slope from column to column and from row to row, of a cubic fit to all pixels."""
    rows, columns = known.shape
    v, u = np.nonzero(known)
    thin = slice(None, None, max(len(v) // 20_000, 1))
    scale = max(rows, columns) / 2
    powers = [(i, j) for i in range(4) for j in range(4 - i)]
    x, y = (u[thin] - columns / 2) / scale, (v[thin] - rows / 2) / scale
    design = np.stack([x**i * y**j for i, j in powers], axis=1)
    factors = np.linalg.lstsq(design, ray[v[thin], u[thin]].astype(np.float64), rcond=None)[0]
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float64)
    x, y = (x - columns / 2) / scale, (y - rows / 2) / scale
    along_x, along_y = np.zeros(known.shape), np.zeros(known.shape)
    for factor, (i, j) in zip(factors, powers, strict=True):
        if i:
            along_x += factor * i * x ** (i - 1) * y**j / scale
        if j:
            along_y += factor * j * x**i * y ** (j - 1) / scale
    return along_x, along_y
