"""Whether lenses and pose are still as calibrated, from one coded picture of a flat target.

Two tests that need no known position. A camera pixel sees the projector along a line: the column it decodes
says where on that line, and so which row it must decode. And points of a plane must be on a plane. Both
leave residuals in projector pixels; what varies smoothly over the image is drift, the rest is rounding.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.calibration.common.plane import TargetPlane
from dsl_core.calibration.common.tiles import tile_of_pixels
from dsl_core.errors import CalibrationError
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import zero_order

Floats = NDArray[np.float64]

#: Drift that shows in a result: a tenth of a column is about 0.2 mm of depth at 700 mm.
LIMIT_PX = 0.1
#: Terms of the smooth part: 1, x, y, x², x y, y².
_TERMS = 6
_MIN_TILES = 3 * _TERMS


def geometry_drift(
    rig: Rig, column: Floats, row: Floats, depth_mm: Floats, plane: TargetPlane
) -> list[Figure]:
    """Drift of rows and columns against the calibration, px; maps are (rows, columns), NaN unknown.

    ``column`` and ``row`` are decoded projector pixels, ``depth_mm`` the triangulated depth of ``column``.
    Raises `CalibrationError` when too little of the image is known.
    """
    known = plane.on_plane & np.isfinite(column) & np.isfinite(row) & np.isfinite(depth_mm)
    _, expected_row = _projected(rig, depth_mm, known)
    on_plane, _ = _projected(rig, plane.plane.depth_mm(rig), known)
    return [
        _figure(
            "row drift",
            smooth_part(row[known] - expected_row, known),
            "Camera, projector or their lenses have moved: repeat the geometry calibration.",
        ),
        _figure(
            "column drift on a plane",
            smooth_part(column[known] - on_plane, known),
            "A lens or the pose has changed, or the target is not flat: try a flat target; if that does not"
            " help, repeat the geometry and depth-stage calibrations.",
        ),
    ]


def smooth_part(residual: Floats, known: NDArray[np.bool_]) -> tuple[float, float]:
    """Rms, with its deviation, of what varies smoothly of residuals (n,) of ``known`` pixels (rows, columns).

    A quadratic through the means of tiles; the scatter of the tiles about it says what noise alone leaves.
    Raises `CalibrationError` when fewer than 18 tiles are known.
    """
    height, width = known.shape
    tiles = tile_of_pixels((width, height))[known]
    count = np.bincount(tiles)
    full = np.bincount(tile_of_pixels((width, height)).ravel())[: len(count)]
    used = count >= 0.5 * full
    if used.sum() < _MIN_TILES:
        raise CalibrationError(
            f"The target fills only {int(used.sum())} tiles of the image; {_MIN_TILES} are needed to tell"
            " drift from noise. Fill the middle of the picture with a flat target."
        )
    rows, columns = np.nonzero(known)
    x, y, value = (
        (np.bincount(tiles, v) / np.maximum(count, 1))[used]
        for v in (2 * columns / width - 1, 2 * rows / height - 1, residual)
    )
    basis = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1)
    orthogonal = np.linalg.qr(basis)[0]
    smooth: Floats = orthogonal @ (orthogonal.T @ value)
    scatter = float(np.sum((value - smooth) ** 2)) / (len(value) - _TERMS)
    # The noise of six fitted terms adds to the square of the smooth part; it is taken out again.
    noise = _TERMS * scatter / len(value)
    rms = max(float(np.mean(smooth**2)) - noise, 0.0) ** 0.5
    return rms, noise**0.5


def _projected(rig: Rig, depth_mm: Floats, known: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Projector columns and rows of known pixels at their depths."""
    pixels = torch.as_tensor(np.flatnonzero(known))
    column, row = zero_order(rig, pixels, torch.as_tensor(depth_mm[known]))
    return column.numpy(), row.numpy()


def _figure(name: str, found: tuple[float, float], advice: str) -> Figure:
    rms, std = found
    return Figure(name=name, value=rms, std=std, unit="px", high=LIMIT_PX, advice=advice)
