"""The camera's relative gain at every pixel."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import FlatField, Rig

Floats = NDArray[np.float64]


def relative_gain(rig: Rig) -> Floats:
    """Gain by which the camera multiplies all light, (rows, columns); (1, 1) of one without a flat field."""
    if rig.flat_field is None:
        return np.ones((1, 1))
    return gain_at_pixels(rig.flat_field, rig.camera.height_px, rig.camera.width_px)


@lru_cache(maxsize=4)
def gain_at_pixels(flat_field: FlatField, height_px: int, width_px: int) -> Floats:
    """Bilinear interpolation at every pixel, shape (rows, columns), read-only."""
    down = _shares(np.arange(height_px, dtype=np.float64), flat_field.rows_px)
    across = _shares(np.arange(width_px, dtype=np.float64), flat_field.columns_px)
    gain: Floats = down @ np.array(flat_field.gain) @ across.T
    gain.setflags(write=False)
    return gain


def _shares(positions: Floats, nodes: tuple[float, ...]) -> Floats:
    """Share of each node at each position, (positions, nodes)."""
    return np.stack([np.interp(positions, nodes, unit) for unit in np.eye(len(nodes))], 1)
