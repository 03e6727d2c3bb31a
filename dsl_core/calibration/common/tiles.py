"""Maps of a smooth quantity, averaged over tiles of the camera image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: Tiles down and across the image, at least this many camera pixels a side.
TILES, MIN_TILE_PX = (32, 48), 4
#: A tile is used when this share of its pixels is known.
MIN_SHARE = 0.6
#: Pixels this many robust deviations from a straight course over their tile are wrong.
OUTLIER_SIGMAS = 5.0


@dataclass(frozen=True)
class ColumnSamples:
    """Projector columns (px) with deviations at sub-pixel camera positions (column, row), shape (n, 2)."""

    camera_px: Floats
    column_px: Floats
    std_px: Floats

    def __len__(self) -> int:
        return len(self.column_px)


def tile_edges(size_px: tuple[int, int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First rows and first columns of the tiles of an image of (width, height), and its ends."""
    width, height = size_px
    counts = [min(n, max(size // MIN_TILE_PX, 1)) for n, size in zip(TILES, (height, width), strict=True)]
    rows, columns = (
        np.linspace(0, size, n + 1).round().astype(np.int64)
        for n, size in zip(counts, (height, width), strict=True)
    )
    return rows, columns


def tile_of_pixels(size_px: tuple[int, int]) -> NDArray[np.int64]:
    """Number of the tile of every pixel, row by row, shape (rows, columns)."""
    rows, columns = tile_edges(size_px)
    down = np.searchsorted(rows, np.arange(size_px[1]), "right") - 1
    across = np.searchsorted(columns, np.arange(size_px[0]), "right") - 1
    return np.asarray(down[:, None] * (len(columns) - 1) + across)


def tile_columns(column_px: NDArray[np.floating], std_px: NDArray[np.floating]) -> ColumnSamples:
    """Mean column of every tile at the mean position of its pixels, weighted alike.

    Maps have shape (rows, columns), NaN where nothing is known. Over a tile columns change almost linearly,
    so that means of columns and of positions belong together; pixels that leave that course are left out.
    """
    height, width = column_px.shape
    tiles = tile_of_pixels((width, height)).ravel()
    x, y = (grid.ravel().astype(float) for grid in np.meshgrid(np.arange(width), np.arange(height)))
    q, std = column_px.ravel().astype(float), std_px.ravel().astype(float)
    good = np.isfinite(q) & np.isfinite(std) & (std > 0)
    weight = np.where(good, 1 / np.where(good, std, 1) ** 2, 0.0)
    course = _straight(tiles, x, y, np.where(good, q, 0.0), weight)
    off = np.abs(q - course)
    limit = OUTLIER_SIGMAS * np.maximum(robust_std(off[good]) if good.any() else 0.0, std)
    weight = np.where(good & (off < limit), weight, 0.0)
    count = tiles.max() + 1
    total = np.bincount(tiles, weight, count)
    used = np.bincount(tiles, weight > 0, count) >= MIN_SHARE * np.bincount(tiles, minlength=count)
    used &= total > 0

    def mean(values: Floats) -> Floats:
        return np.asarray(np.bincount(tiles, weight * values, count)[used] / total[used])

    return ColumnSamples(
        np.stack([mean(x), mean(y)], 1), mean(np.where(good, q, 0.0)), 1 / np.sqrt(total[used])
    )


def _straight(tiles: NDArray[np.int64], x: Floats, y: Floats, values: Floats, weight: Floats) -> Floats:
    """Weighted plane through the values of each tile, at every pixel."""
    count = int(tiles.max()) + 1
    total = np.maximum(np.bincount(tiles, weight, count), 1e-30)

    def centred(v: Floats) -> tuple[Floats, Floats]:
        middle = np.bincount(tiles, weight * v, count) / total
        return v - middle[tiles], middle

    (dx, _), (dy, _), (dv, middle) = centred(x), centred(y), centred(values)
    xx, xy, yy, xv, yv = (
        np.bincount(tiles, weight * a * b, count)
        for a, b in ((dx, dx), (dx, dy), (dy, dy), (dx, dv), (dy, dv))
    )
    determinant = xx * yy - xy**2
    safe = np.where(determinant > 1e-9 * np.maximum(xx * yy, 1e-30), determinant, np.inf)
    across, down = (yy * xv - xy * yv) / safe, (xx * yv - xy * xv) / safe
    return np.asarray(middle[tiles] + across[tiles] * dx + down[tiles] * dy)
