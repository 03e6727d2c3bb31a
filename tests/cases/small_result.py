"""A small result with every variable, some unlit pixels and some flagged ones, known to the last digit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.result import Flag, Reach, build_result

if TYPE_CHECKING:
    import xarray as xr

ROWS, COLUMNS = 6, 9
WAVELENGTHS_NM = np.array([430.0, 432.5, 550.0, 655.0, 660.0])
#: Bands that are near enough for a colour, which those above are not.
OF_COLOUR_NM = np.arange(430.0, 661.0, 23.0)
#: (row, column) of pixels without any answer, and of one with an answer and a warning.
UNLIT = (0, 3)
UNSURE = (5, 8)
WARNED = (2, 4)


def small_result(bands_nm: NDArray[np.float64] = WAVELENGTHS_NM) -> xr.Dataset:
    """A result of 6 x 9 pixels and 5 bands, unless others are given."""
    rng = np.random.default_rng(7)
    y, x = np.mgrid[0:ROWS, 0:COLUMNS].astype(np.float32)
    depth = (700 + 3 * x - 2 * y).astype(np.float32)
    points = np.stack([(x - 4) * depth / 900, (y - 3) * depth / 900, depth]).astype(np.float32)
    normals = np.broadcast_to(np.array([0.6, 0, -0.8], np.float32)[:, None, None], points.shape).copy()
    cube = (len(bands_nm), ROWS, COLUMNS)
    arrays = {
        "depth_mm": depth,
        "depth_std_mm": (0.2 + 0.01 * x).astype(np.float32),
        "column_px": (100 + 20 * x).astype(np.float32),
        "column_std_px": np.full((ROWS, COLUMNS), 0.05, np.float32),
        "points_mm": points,
        "normals": normals,
        "shading": np.full((ROWS, COLUMNS), 0.9, np.float32),
        "reflectance": rng.uniform(0.02, 0.98, cube).astype(np.float32),
        "reflectance_std": rng.uniform(0.002, 0.05, cube).astype(np.float32),
        "data_share": rng.uniform(0, 1, cube).astype(np.float32),
        "rgb": rng.uniform(0, 1, (3, ROWS, COLUMNS)).astype(np.float32),
    }
    flags = np.zeros((ROWS, COLUMNS), np.uint16)
    flags[UNLIT], flags[UNSURE] = Flag.NO_LIGHT, Flag.CODE_UNSURE | Flag.DEPTH_EDGE
    flags[WARNED] = Flag.BANDS_UNREACHED
    for values in arrays.values():
        values[..., (flags & 15) != 0] = np.nan
    reach = np.full(cube, Reach.PLUS_ONE, np.uint8)
    reach[-1] = Reach.PLUS_ONE | Reach.MINUS_ONE
    reach[(-1, *WARNED)] = Reach.ZERO_ONLY
    attributes: dict[str, str | int | float] = {
        "scan_id": "2026-05-04-chart",
        "software_version": "0.1.0",
        "calibration": "twin μ-rig",  # text outside ASCII must survive wherever a format can hold it
        "white_scale": 12.5,
    }
    return build_result({**arrays, "reach": reach, "flags": flags}, bands_nm, attributes)
