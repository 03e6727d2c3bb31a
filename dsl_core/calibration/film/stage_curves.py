"""Columns of first orders over depth in the middle of the picture, as each model has them and as measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.calibration.depth_stage import DepthStageCalibration, apply_depth_stage
from dsl_core.model.rig import CorrespondenceGrid, Rig

Floats = NDArray[np.float64]
#: Depths at which curves are drawn.
COUNT = 41
ORDERS = (1, -1)


@dataclass(frozen=True)
class StageCurve:
    """One order at one filter's wavelength: columns (px) by film and residual, and by the data-driven grid.

    NaN where the light would come from beside the projector's frame, so that nothing was measured.

    ``depth_mm``, ``film_px`` and ``grid_px`` (None without a grid) are curves. ``seen_mm`` are positions of
    the stage, ``seen_film_px`` the film's columns there, and ``shift_px`` by how much the median over the
    whole picture was measured beside them.
    """

    order: int
    filter_nm: float
    depth_mm: Floats
    film_px: Floats
    grid_px: Floats | None
    seen_mm: Floats
    seen_film_px: Floats
    shift_px: Floats

    @property
    def seen_px(self) -> Floats:
        """Columns as measured at the positions of the stage."""
        return self.seen_film_px + self.shift_px


def stage_curves(record: DepthStageCalibration, rig: Rig) -> tuple[StageCurve, ...]:
    """A curve for each order and filter; ``rig`` is what was known before."""
    import torch

    from dsl_core.optics.correspondence import HybridModel

    known = apply_depth_stage(record, rig)
    model, grid = HybridModel(known), record.correspondence
    row, column = _middle(known, grid)
    seen_mm = np.array([position.distance_mm for position in record.positions])
    depth_mm = np.linspace(seen_mm.min(), seen_mm.max(), COUNT)

    def film_px(depths_mm: Floats, order: int, nm: float) -> Floats:
        pixels = torch.full((len(depths_mm),), row * known.camera.width_px + column)
        seen = model.exact(pixels, torch.as_tensor(depths_mm), order, np.array([nm]))
        inside = seen.inside(known.projector.width_px, known.projector.height_px)
        return np.where(inside[0], seen.columns[0], np.nan)

    curves = []
    for order in ORDERS:
        for each in record.filters:
            film, seen = (film_px(depths, order, each.effective_nm) for depths in (depth_mm, seen_mm))
            laws = None
            if grid is not None and order in grid.orders:
                laws = _grid_px(grid, depth_mm, order, each.effective_nm, (row, column)) + 0 * film
            # Shifts are noted away from the zero order, which is to the other side for the order -1.
            shift = order * np.array(each.shift_px)
            curves.append(StageCurve(order, each.filter_nm, depth_mm, film, laws, seen_mm, seen, shift))
    return tuple(curves)


def _middle(rig: Rig, grid: CorrespondenceGrid | None) -> tuple[int, int]:
    """Row and column of the grid's node nearest to the middle of the picture, or of the middle itself."""
    middle = ((rig.camera.height_px - 1) / 2, (rig.camera.width_px - 1) / 2)
    nodes = (
        middle
        if grid is None
        else tuple(
            min(of, key=lambda node, at=at: abs(node - at))  # type: ignore[misc]
            for of, at in zip((grid.rows_px, grid.columns_px), middle, strict=True)
        )
    )
    return round(nodes[0]), round(nodes[1])


def _grid_px(
    grid: CorrespondenceGrid, depth_mm: Floats, order: int, nm: float, node: tuple[int, int]
) -> Floats:
    """Columns by the power laws of a node, linear between wavelengths."""
    row, column = grid.rows_px.index(node[0]), grid.columns_px.index(node[1])
    laws = grid.array[grid.orders.index(order), :, row, column]
    columns = [a * (depth_mm / grid.depth_unit_mm) ** b + c for a, b, c in laws]
    at = np.interp(nm, grid.wavelengths_nm, np.arange(len(columns)))
    low, high = int(np.floor(at)), int(np.ceil(at))
    return np.asarray(columns[low] + (at - low) * (columns[high] - columns[low]))
