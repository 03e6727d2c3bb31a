"""The data-driven grid of seed section 4 from the samples of a depth stage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import tile_edges
from dsl_core.calibration.film.correspondence import GridFit, GridSamples, fit_grid
from dsl_core.calibration.film.film import OrderSamples, grating_columns
from dsl_core.model.rig import CorrespondenceGrid, Rig

Floats = NDArray[np.float64]

#: Significant digits of the coefficients: a thousandth of a pixel, at half the size on disk.
DIGITS = 8


def fit_stage_grid(rig: Rig, samples: OrderSamples) -> GridFit:
    """Eq. (2) of the seed at the middles of all tiles, from samples of planes at three positions or more.

    The grid wants the same depths and wavelengths at every node; what samples differ from these is little,
    and is taken from the fitted film of ``rig``. Raises `CalibrationError` as `fit_grid` does.
    """
    fit = fit_grid(grid_samples(rig, samples))
    return replace(fit, grid=_rounded(fit.grid))


def grid_samples(rig: Rig, samples: OrderSamples) -> GridSamples:
    """The samples on a grid of tiles, at one depth a position and one wavelength a filter."""
    rows, columns = (
        (edges[1:] + edges[:-1] - 1) / 2 for edges in tile_edges((rig.camera.width_px, rig.camera.height_px))
    )
    # Nodes are whole pixels, where the film's model is evaluated.
    rows, columns = np.unique(np.rint(rows)), np.unique(np.rint(columns))
    depths = _means(samples.position, samples.depth_mm)
    wavelengths = _means(samples.filter, samples.wavelength_nm)
    down, across = np.divmod(samples.tile, len(columns))
    node = (rows[down] * rig.camera.width_px + columns[across]).astype(np.int64)
    position, name = (np.unique(of, return_inverse=True)[1] for of in (samples.position, samples.filter))
    there = replace(samples, pixel=node, depth_mm=depths[position], wavelength_nm=wavelengths[name])
    moved = samples.column_px + grating_columns(rig, there) - grating_columns(rig, samples)
    orders = sorted({int(m) for m in samples.order}, reverse=True)
    values = np.full((len(orders), len(wavelengths), len(depths), len(rows), len(columns)), np.nan)
    which = np.array([orders.index(int(m)) for m in samples.order])
    values[which, name, position, down, across] = moved
    return GridSamples(tuple(orders), wavelengths, depths, rows, columns, values)


def _means(of: NDArray[np.int64], values: Floats) -> Floats:
    """Mean of the values of each index that occurs."""
    _, which, counts = np.unique(of, return_inverse=True, return_counts=True)
    return np.asarray(np.bincount(which, values) / counts)


def _rounded(grid: CorrespondenceGrid) -> CorrespondenceGrid:
    return grid.model_copy(
        update={"coefficients": tuple(float(f"{value:.{DIGITS}g}") for value in grid.coefficients)}
    )
