"""How a cloud is looked at: what is drawn, from where, and the grid that its points come from. No Qt."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.grid_mesh import mesh_of_grid

Points = NDArray[np.float32]
#: Bits of the width of the tile by which points are ordered.
TILE_BITS = 4


def _bayer(bits: int) -> NDArray[np.int64]:
    """Ranks of a square tile of 2**bits, of which the first are always evenly spread.

    >>> _bayer(1).tolist()
    [[0, 2], [3, 1]]
    """
    ranks = np.zeros((1, 1), np.int64)
    for _ in range(bits):
        ranks = np.block([[4 * ranks, 4 * ranks + 2], [4 * ranks + 3, 4 * ranks + 1]])
    return ranks


class Side(Enum):
    """Where a cloud is seen from: the place of the camera, or a side from outside the cloud."""

    CAMERA = "camera"
    FRONT = "front"
    TOP = "top"
    LEFT = "left"
    RIGHT = "right"


Direction = tuple[float, float, float]
#: Directions of view and of up for each side, in the camera's frame: x right, y down, z away.
DIRECTIONS: dict[Side, tuple[Direction, Direction]] = {
    Side.CAMERA: ((0, 0, 1), (0, -1, 0)),
    Side.FRONT: ((0, 0, 1), (0, -1, 0)),
    Side.TOP: ((0, 1, 0), (0, 0, 1)),
    Side.LEFT: ((1, 0, 0), (0, -1, 0)),
    Side.RIGHT: ((-1, 0, 0), (0, -1, 0)),
}


@dataclass(frozen=True)
class Look:
    """What is drawn: a surface or points, of ``size`` times the distance to their neighbours.

    ``light`` shades the surface, ``depth_shade`` darkens what has something nearer beside it (eye-dome
    lighting), ``parallel`` draws equal lengths equally long, ``box`` shows the extent in mm.
    """

    surface: bool = True
    size: float = 1.0
    light: bool = True
    depth_shade: bool = False
    parallel: bool = False
    box: bool = False


@dataclass(frozen=True, eq=False)
class Grid:
    """The picture of (rows, columns) that points come from.

    ``flat`` is the pixel of each point, ascending; ``std_mm`` and ``edge`` are maps of the picture,
    ``normals`` has three of them.
    """

    shape: tuple[int, int]
    flat: NDArray[np.intp]
    std_mm: NDArray[np.float32] | None = None
    edge: NDArray[np.bool_] | None = None
    normals: NDArray[np.float32] | None = None

    def mesh(self, points: Points, every: int) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
        """Vertices as indices of points, and triangles (n, 3) of vertices, of each ``every``-th pixel."""
        rows, columns = self.shape
        whole = np.full((3, rows * columns), np.nan, np.float32)
        whole[:, self.flat] = points.T
        mesh = mesh_of_grid(whole.reshape(3, rows, columns), self.std_mm, self.edge, every)
        return np.searchsorted(self.flat, mesh.pixels), mesh.triangles

    def even_order(self) -> NDArray[np.int32]:
        """The order of points by which the first of them, however many, are evenly spread in the picture.

        Pixels are taken as ordered dithering (B. E. Bayer, 1973) turns them on.
        """
        y, x = np.divmod(self.flat, self.shape[1])
        return np.argsort(_bayer(TILE_BITS)[y % 2**TILE_BITS, x % 2**TILE_BITS], kind="stable").astype(
            np.int32
        )

    def normals_at(self, vertices: NDArray[np.intp]) -> NDArray[np.float32] | None:
        """Unit normals (vertices, 3); None where the result knows none. Without one it faces the camera."""
        if self.normals is None:
            return None
        found = self.normals.reshape(3, -1)[:, self.flat[vertices]].T.astype(np.float32)
        found[~np.isfinite(found).all(1)] = (0, 0, -1)
        return found
