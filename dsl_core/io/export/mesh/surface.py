"""What the mesh formats write: vertices, triangles and a texture, made from a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.export.common import colours, plane, require
from dsl_core.io.export.png import rgb_picture
from dsl_core.model.result import Flag
from dsl_core.solve.grid_mesh import GridMesh, mesh_of_grid, normals_of
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Surface:
    """Vertices (n, 3) in mm in the camera's frame, unit normals (n, 3), places in the texture (n, 2).

    Places run from 0 to 1, right and down from the upper left corner; triangles (m, 3) are counter-clockwise
    as the camera sees them. ``texture`` are sRGB bytes (rows, columns, 3); None without colours.
    """

    points_mm: NDArray[np.float32]
    normals: NDArray[np.float32]
    places: NDArray[np.float32]
    triangles: NDArray[np.int32]
    texture: NDArray[np.uint8] | None


def grid_of(result: xr.Dataset, every: int = 1) -> GridMesh:
    """Triangles of a result, of which only each ``every``-th row and column is used; raises `StoreError`."""
    require(result, "A mesh", "points_mm")
    points = plane(result, "points_mm")
    size = f"{points.shape[2]} x {points.shape[1]}"
    if min(points.shape[1:]) < 2:
        raise StoreError(
            f"A mesh needs two rows and two columns of pixels, and this result is {size}. Export its"
            " points as PLY."
        )
    if not 1 <= every <= min(points.shape[1:]) // 2:
        raise StoreError(
            f"A step of {every} pixels was requested of a result of {size}. That leaves no surface. Choose 1"
            " for all pixels, or a small number such as 4."
        )
    std = plane(result, "depth_std_mm") if "depth_std_mm" in result else None
    edge = (result["flags"].values & int(Flag.DEPTH_EDGE)) != 0 if "flags" in result else None
    mesh = mesh_of_grid(points, std, edge, every)
    if mesh.pixels.size == 0:
        raise StoreError(
            "No two neighbouring pixels of this result have a depth, so there is no surface to write."
            " Export the points as PLY, or reconstruct a scan with more light."
        )
    return mesh


def surface_of(result: xr.Dataset, every: int = 1, check: Check = never) -> Surface:
    """The surface of a result with its texture; raises `StoreError`."""
    mesh = grid_of(result, every)
    check()
    points = plane(result, "points_mm")
    rows, columns = points.shape[1:]
    vertices = np.ascontiguousarray(points.reshape(3, -1)[:, mesh.pixels].T)
    check()
    y, x = np.divmod(mesh.pixels, columns)
    # The centre of a pixel is half a pixel from the edge of the texture.
    places = np.stack([(x + 0.5) / columns, (y + 0.5) / rows], axis=1).astype(np.float32)
    normals = normals_of(vertices, mesh.triangles)
    if "normals" in result:
        fitted = plane(result, "normals").reshape(3, -1)[:, mesh.pixels].T
        known = np.isfinite(fitted).all(1)
        normals[known] = fitted[known] / np.linalg.norm(fitted[known], axis=1, keepdims=True)
    rgb = colours(result)
    texture = None if rgb is None else _texture(rgb)
    return Surface(vertices, normals, places, mesh.triangles, texture)


def _texture(rgb: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colours as bytes; pixels without one take that of the nearest, so that none bleeds in at edges."""
    known: NDArray[np.bool_] = np.asarray(np.isfinite(rgb).all(0))
    if not known.any() or known.all():
        return rgb_picture(rgb)
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return rgb_picture(rgb[:, nearest[0], nearest[1]])


def png_bytes(texture: NDArray[np.uint8]) -> bytes:
    """A texture as the bytes of a PNG file."""
    import io

    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(texture).save(file, format="PNG")
    return file.getvalue()
