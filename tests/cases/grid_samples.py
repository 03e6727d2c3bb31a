"""Samples of a rig's grating on a grid over the camera image, as the published calibration takes them."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.calibration.film.correspondence import GridSamples
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import GratingModel

Floats = NDArray[np.float64]

#: The published sampling: grid of 48 x 85 nodes, filters in nm.
GRID = (48, 85)
PUBLISHED_NM = (430.0, 600.0, 610.0, 620.0, 640.0, 650.0, 660.0)


def grid_nodes(rig: Rig, grid: tuple[int, int] = GRID) -> tuple[Floats, Floats]:
    """Rows and columns (px) of a grid over the whole camera image, edges included."""
    rows = np.linspace(0, rig.camera.height_px - 1, grid[0])
    columns = np.linspace(0, rig.camera.width_px - 1, grid[1])
    return rows, columns


def sample_grating(
    rig: Rig,
    depths_mm: Floats,
    wavelengths_nm: Floats,
    orders: tuple[int, ...] = (1, -1),
    grid: tuple[int, int] = GRID,
) -> GridSamples:
    """Samples of a rig's analytic model at whole camera pixels; NaN outside the projector's frame."""
    rows, columns = (np.unique(np.round(nodes)) for nodes in grid_nodes(rig, grid))
    flat = (rows[:, None] * rig.camera.width_px + columns).astype(np.int64).ravel()
    pixels, model = torch.as_tensor(flat), GratingModel(rig)
    values = np.empty((len(orders), len(wavelengths_nm), len(depths_mm), len(rows), len(columns)))
    for i, order in enumerate(orders):
        for k, depth in enumerate(depths_mm):
            at = torch.full((flat.size,), float(depth), dtype=torch.float64)
            seen = model.exact(pixels, at, order, wavelengths_nm)
            inside = seen.inside(rig.projector.width_px, rig.projector.height_px)
            lit = torch.where(inside, seen.columns, torch.nan).numpy()
            values[i, :, k] = lit.reshape(len(wavelengths_nm), len(rows), len(columns))
    return GridSamples(orders, np.asarray(wavelengths_nm), np.asarray(depths_mm), rows, columns, values)
