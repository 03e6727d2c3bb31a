"""The data-driven correspondence as published, fitted to samples of a flat target on a stage.

At every node of a grid over the camera image, and for every order and filter wavelength, the projector column
that lights the node is known at a few depths. Eq. (2) of the supplement of Shin et al. (CVPR 2024) is fitted
to them::

    q = alpha * z**beta + gamma

For a given exponent the other two are linear, so that only the exponent is searched (variable projection):
first on a fixed set, which no start value can mislead, then by golden sections, all nodes at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import tile_edges
from dsl_core.calibration.film.order_samples import OrderSamples, grating_columns
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import CorrespondenceGrid, Rig
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

DEPTH_UNIT_MM = 1000.0
#: Exponents that are searched. A point seen off the projector's axis moves as 1/z; lens distortion and film
#: bend change that a little. Near zero the model degenerates to a line in log z, which is left out.
EXPONENTS = np.concatenate([np.linspace(-4.0, -0.1, 40), np.linspace(0.1, 2.0, 20)])
GOLDEN_STEPS, OFF_AXIS = 30, -1.0
#: Residuals beyond this many robust deviations are wrong samples (a lost peak, a neighbouring order).
OUTLIER_SIGMAS = 6.0
#: Columns are never better than this (px), so that exact samples have no outliers.
FLOOR_PX = 0.02
ROBUST_ROUNDS = 3
#: Depths a node needs, and nodes a wavelength needs to carry the polynomials of this degree.
MIN_DEPTHS, MIN_NODES, DEGREE = 3, 20, 3
#: Significant digits of the coefficients: a thousandth of a pixel, at half the size on disk.
DIGITS = 8


@dataclass(frozen=True)
class GridSamples:
    """Measured columns (px) on a grid; NaN where no peak was found.

    ``columns_px`` has shape (orders, wavelengths, depths, rows, columns).
    """

    orders: tuple[int, ...]
    wavelengths_nm: Floats
    depths_mm: Floats
    rows_px: Floats
    columns_at_px: Floats
    columns_px: Floats


@dataclass(frozen=True)
class GridFit:
    """The fitted model, residuals (px) shaped like the samples (NaN where unused), and a sentence on them."""

    grid: CorrespondenceGrid
    residual_px: Floats

    @property
    def rms_px(self) -> float:
        """Root mean square of the used residuals."""
        return float(np.sqrt(np.nanmean(self.residual_px**2)))


def fit_grid(samples: GridSamples) -> GridFit:
    """Fit Eq. (2) at every node, order and wavelength, leaving wrong samples out.

    Alpha, beta and gamma of a node nearly compensate each other, so that noise moves all three; the exponents
    are therefore smoothed over the image and the other two fitted again, which keeps them fit to be
    interpolated. Nodes that too few depths reach are extrapolated. Raises `CalibrationError` when depths,
    wavelengths or samples do not suffice.
    """
    _check(samples)
    maps = np.empty((*samples.columns_px.shape[:2], len(samples.rows_px), len(samples.columns_at_px), 3))
    residual = np.full_like(samples.columns_px, np.nan)
    for order, nm in np.ndindex(maps.shape[:2]):
        values = samples.columns_px[order, nm]
        name = f"Order {samples.orders[order]:+d} at {samples.wavelengths_nm[nm]:g} nm"
        maps[order, nm], residual[order, nm] = _fit_map(values, samples, name)
    return GridFit(_record(samples, maps), residual)


def _fit_map(values: Floats, samples: GridSamples, name: str) -> tuple[Floats, Floats]:
    """Coefficients (rows, columns, 3) and residuals of samples (depths, rows, columns) of one wavelength."""
    shape = values.shape[1:]
    z = samples.depths_mm / DEPTH_UNIT_MM
    q = values.reshape(len(z), -1).T
    used = np.isfinite(q)
    for _ in range(ROBUST_ROUNDS):
        enough = used.sum(1) >= MIN_DEPTHS
        if enough.sum() < MIN_NODES:
            raise CalibrationError(
                f"{name} was found at {MIN_DEPTHS} or more depths at only {enough.sum()} grid nodes;"
                f" {MIN_NODES} are needed. Check the filter and the exposure, or leave this wavelength out."
            )
        beta, weight = np.full(len(q), np.nan), np.zeros(len(q))
        beta[enough] = _exponents(z, q[enough], used[enough])
        weight[enough] = _sensitivity(beta[enough], z, q[enough], used[enough])
        # Where columns do not move with depth any exponent fits, and that of a point off the axis is taken.
        beta = (
            _smooth(beta.reshape(shape), weight.reshape(shape)).ravel()
            if (weight > 0).any()
            else np.full(len(q), OFF_AXIS)
        )
        linear = np.full((len(q), 2), np.nan)
        linear[enough] = _linear(beta[enough], z, q[enough], used[enough])[1]
        residual = q - (linear[:, :1] * z ** beta[:, None] + linear[:, 1:])
        wrong = used & (np.abs(residual) > _outlier_limit(residual, used))
        if not wrong.any():
            break
        used &= ~wrong
    alpha, gamma = (_filled(part.reshape(shape)) for part in linear.T)
    kept = np.where(used & enough[:, None], residual, np.nan)
    return np.stack([alpha, beta.reshape(shape), gamma], -1), kept.T.reshape(values.shape)


def _check(samples: GridSamples) -> None:
    if (
        len(set(samples.depths_mm.tolist())) < 3
        or np.ptp(samples.depths_mm) < 0.05 * samples.depths_mm.mean()
    ):
        raise CalibrationError(
            "The correspondence needs samples at three or more different depths, not"
            f" {', '.join(f'{z:g}' for z in samples.depths_mm)} mm. Move the stage further between scans."
        )
    if len(samples.wavelengths_nm) < 2 or (np.diff(samples.wavelengths_nm) <= 0).any():
        raise CalibrationError(
            "The correspondence needs two or more wavelengths in rising order, not"
            f" {', '.join(f'{nm:g}' for nm in samples.wavelengths_nm)} nm. Add bandpass filters or sort them."
        )
    if min(len(samples.rows_px), len(samples.columns_at_px)) < 2:
        raise CalibrationError("The correspondence needs a grid of at least 2 x 2 camera pixels.")


def _exponents(z: Floats, q: Floats, used: NDArray[np.bool_]) -> Floats:
    """Exponents (nodes,) that minimise the squared residuals of used samples (nodes, depths)."""
    costs = np.stack([_linear(np.full(len(q), beta), z, q, used)[0] for beta in EXPONENTS])
    best = costs.argmin(0)
    low = EXPONENTS[np.maximum(best - 1, 0)]
    high = EXPONENTS[np.minimum(best + 1, len(EXPONENTS) - 1)]
    ratio = (np.sqrt(5) - 1) / 2
    for _ in range(GOLDEN_STEPS):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        smaller = _linear(left, z, q, used)[0] < _linear(right, z, q, used)[0]
        low, high = np.where(smaller, low, left), np.where(smaller, right, high)
    return np.asarray(0.5 * (low + high))


def _sensitivity(beta: Floats, z: Floats, q: Floats, used: NDArray[np.bool_]) -> Floats:
    """Information (nodes,) that samples hold on the exponent, per variance of a sample."""
    alpha = _linear(beta, z, q, used)[1][:, :1]
    slope = alpha * np.log(z) * z ** beta[:, None]
    return _linear(beta, z, slope, used)[0]


def _linear(beta: Floats, z: Floats, q: Floats, used: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Cost (nodes,) and alpha, gamma (nodes, 2) for given exponents, by centred sums."""
    # Depths come first: sums of a few values each, over thousands of nodes at once.
    power = np.exp(np.log(z)[:, None] * beta)
    used, q = np.ascontiguousarray(used.T), np.ascontiguousarray(q.T)
    count = used.sum(0)
    mean_p = np.where(used, power, 0).sum(0) / count
    mean_q = np.where(used, q, 0).sum(0) / count
    dp = np.where(used, power - mean_p, 0.0)
    dq = np.where(used, q - mean_q, 0.0)
    alpha = (dp * dq).sum(0) / np.maximum((dp * dp).sum(0), 1e-30)
    cost = ((dq - alpha * dp) ** 2).sum(0)
    return cost, np.stack([alpha, mean_q - alpha * mean_p], 1)


def _outlier_limit(residual: Floats, used: NDArray[np.bool_]) -> float:
    """Limit (px) from the median absolute residual of all nodes."""
    return OUTLIER_SIGMAS * max(float(robust_std(residual[used & np.isfinite(residual)])), FLOOR_PX)


def _smooth(values: Floats, weight: Floats) -> Floats:
    """Weighted cubic polynomial of a map (rows, columns), everywhere; robust by cutting the weights."""
    v, u = (np.linspace(-1, 1, n) for n in values.shape)
    terms = [np.outer(v**i, u**j).ravel() for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    basis = np.stack(terms, 1)
    # No node outweighs typical ones much: otherwise a few at the edge of the image would decide everywhere.
    known = weight.ravel() > 0
    root = np.sqrt(np.minimum(weight.ravel()[known], 4 * np.median(weight.ravel()[known])))
    solution = np.linalg.lstsq(basis[known] * root[:, None], values.ravel()[known] * root, rcond=None)[0]
    return np.asarray((basis @ solution).reshape(values.shape))


def _filled(values: Floats) -> Floats:
    """Extrapolate a map smoothly into nodes without a value: polynomial plus the nearest node's deviation."""
    from scipy.ndimage import distance_transform_edt

    missing = ~np.isfinite(values)
    if not missing.any():
        return values
    trend = _smooth(np.where(missing, 0.0, values), (~missing).astype(float))
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(np.where(missing, trend + (values - trend)[tuple(nearest)], values))


def _record(samples: GridSamples, maps: Floats) -> CorrespondenceGrid:
    return CorrespondenceGrid(
        orders=samples.orders,
        wavelengths_nm=tuple(samples.wavelengths_nm.tolist()),
        rows_px=tuple(samples.rows_px.tolist()),
        columns_px=tuple(samples.columns_at_px.tolist()),
        depth_unit_mm=DEPTH_UNIT_MM,
        depth_range_mm=(float(samples.depths_mm.min()), float(samples.depths_mm.max())),
        coefficients=tuple(maps.ravel().tolist()),
    )


def fit_stage_grid(rig: Rig, samples: OrderSamples) -> GridFit:
    """Eq. (2) at the middles of all tiles, from samples of planes at three positions or more.

    The grid needs the same depths and wavelengths at every node; samples differ from these a little, which
    the fitted film of ``rig`` corrects. Raises `CalibrationError` as `fit_grid` does.
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
