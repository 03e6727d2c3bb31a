"""How large what a pixel sees is, so that classes have areas."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Cube = NDArray[np.float32] | NDArray[np.float64]
Map = NDArray[np.float64]

#: A surface seen at a flatter angle than this cosine is not measured by the pixels that see it.
LEAST_COSINE = 0.1


#: Columns and rows of the camera's picture, whole numbers, that pixels are in; None where nobody says.
Places = tuple[NDArray[np.integer] | None, NDArray[np.integer] | None]


def pixel_areas_mm2(points_mm: Cube, normals: Cube | None = None, places_px: Places = (None, None)) -> Map:
    """Area of the surface that each pixel sees, mm2, (rows, columns); NaN without a point.

    NaN everywhere where all points lie on one line of pixels, which does not say how far apart rays are.

    ``points_mm`` and ``normals`` are (3, rows, columns) in camera coordinates. The pixel's cone of rays cuts
    ``z^2 J / |n . r|`` out of a plane with normal n: r is the ray with unit depth, J the area between
    neighbouring rays, from a smooth fit to all rays. Triangles between the points themselves would grow with
    the noise of depth. Without a normal the surface is taken to face the camera's axis.

    ``places_px`` say where columns or rows have been left out. Of every n-th column, each stands for n.
    """
    depth = points_mm[2].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        ray_x, ray_y = points_mm[0] / depth, points_mm[1] / depth
    known = np.isfinite(ray_x) & np.isfinite(ray_y)
    columns, rows = (_steps(at, size) for at, size in zip(places_px, depth.shape[::-1], strict=True))
    gradients = _gradients(np.stack([ray_x, ray_y]), known, columns, rows)
    if gradients is None:
        return np.full(depth.shape, np.nan)
    (xx, xy), (yx, yy) = gradients
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


def _steps(places_px: NDArray[np.integer] | None, size: int) -> Map:
    """Places in the steps that pixels are apart where none are left out."""
    if places_px is None or size < 2:
        return np.arange(size, dtype=np.float64)
    step = max(int(np.gcd.reduce(np.diff(places_px))), 1)
    return np.asarray((places_px - places_px.min()) / step)


def _gradients(
    rays: Map, known: NDArray[np.bool_], columns: Map, rows: Map
) -> tuple[tuple[Map, Map], ...] | None:
    """Change of rays' slopes (2, rows, columns) per column and per row, of fits to known pixels.

    A cubic where pixels are spread widely enough, in few columns or rows the polynomial that they determine;
    None where that is none.
    """
    at_row, at_column = np.nonzero(known)
    if not at_row.size:
        return None
    thin = slice(None, None, max(at_row.size // 20_000, 1))
    u, v = columns[at_column], rows[at_row]
    # By the pixels that are known: in a narrow strip of a large picture, powers would all but coincide.
    middles = [(at.min() + at.max()) / 2 for at in (u, v)]
    scales = [max((at.max() - at.min()) / 2, 0.5) for at in (u, v)]
    x, y = ((at[thin] - middle) / scale for at, middle, scale in zip((u, v), middles, scales, strict=True))
    slopes = rays[:, at_row[thin], at_column[thin]].T.astype(np.float64)
    for degree in (3, 2, 1):
        powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
        design = np.stack([x**i * y**j for i, j in powers], axis=1)
        factors, _, rank, _ = np.linalg.lstsq(design, slopes, rcond=None)
        if rank == len(powers):
            break
    else:
        return None
    column, row = np.meshgrid(columns, rows)
    places = (column - middles[0]) / scales[0], (row - middles[1]) / scales[1]
    return tuple(_derivatives(each, powers, places, scales) for each in factors.T)


def _derivatives(
    factors: Map, powers: list[tuple[int, int]], places: tuple[Map, Map], scales: list[float]
) -> tuple[Map, Map]:
    """Of a polynomial with factors of ``x**i * y**j``, per column and per row, at scaled places."""
    x, y = places
    along_x, along_y = np.zeros(x.shape), np.zeros(x.shape)
    for factor, (i, j) in zip(factors, powers, strict=True):
        if i:
            along_x += factor * i * x ** (i - 1) * y**j / scales[0]
        if j:
            along_y += factor * j * x**i * y ** (j - 1) / scales[1]
    return along_x, along_y
