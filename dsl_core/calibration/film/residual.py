"""A smooth correction of what the grating equation leaves over, no richer than the data ask for.

Products of Chebyshev polynomials in camera column, row, inverse depth and wavelength, up to a total degree;
each axis only as far as positions and filters determine it. Which degree is decided on samples that were
left out: whole positions, whole filters, and a random third.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.calibration.film.fit import FLOOR_PX, HUBER_SIGMAS, fit_film
from dsl_core.calibration.film.order_samples import OrderSamples, grating_columns
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.depth_stage import HeldOutError
from dsl_core.model.rig import ColumnResidual, Rig
from dsl_core.optics.column_residual import chebyshev, residual_columns, scaled
from dsl_core.progress import NoProgress, Progress
from dsl_core.solve.robust import huber_weights

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

MAX_DEGREE = 3
#: A richer correction must lower the error on left-out samples by this share.
MIN_GAIN = 0.02
#: Coefficients are expected to be no larger than this (px), which keeps unseen combinations near zero.
COEFFICIENT_STD_PX = 0.3
ROUNDS = 5
WAVELENGTH_RANGE_NM = (430.0, 660.0)


def choose_residual(
    rig: Rig,
    samples: OrderSamples,
    positions: Sequence[str],
    filters: Sequence[str],
    progress: Progress | None = None,
) -> tuple[ColumnResidual, tuple[HeldOutError, ...]]:
    """The correction for the film of ``rig``, and the errors on what was left out.

    Film and correction are fitted again without each position, each filter, and a third
    of the samples; ``positions`` and ``filters`` are their names.
    """
    progress, shaped = progress or NoProgress(), rig.film.shape is not None
    folds = list(_folds(samples, positions, filters))
    errors = np.empty((MAX_DEGREE + 1, len(folds)))
    noise = np.empty(len(folds))
    for i, (_, out) in enumerate(folds):
        progress.report("hold captures out", i, len(folds))
        film = fit_film(rig, samples.only(~out), rig.film, rounds=3, shaped=shaped).film
        again = rig.model_copy(update={"film": film})
        inside, outside = samples.only(~out), samples.only(out)
        left = outside.column_px - grating_columns(again, outside)
        noise[i] = _trimmed_rms(outside.std_px)
        for degree in range(MAX_DEGREE + 1):
            found = fit_residual(again, inside, degree)
            errors[degree, i] = _trimmed_rms(left - correction_px(rig, found, outside))
    total = np.sqrt((errors**2).mean(1))
    best = 0
    for degree in range(1, MAX_DEGREE + 1):
        if total[degree] < (1 - MIN_GAIN) * total[best]:
            best = degree
    table = tuple(
        HeldOutError(
            kept_out=name,
            grating_px=float(errors[0, i]),
            hybrid_px=float(errors[best, i]),
            noise_px=float(noise[i]),
        )
        for i, (name, _) in enumerate(folds)
    )
    return fit_residual(rig, samples, best), table


def fit_residual(rig: Rig, samples: OrderSamples, degree: int) -> ColumnResidual:
    """Correction of a total degree; none for degree zero. Robust, with a prior of `COEFFICIENT_STD_PX`."""
    orders = tuple(sorted({int(m) for m in samples.order}, reverse=True))
    blank = ColumnResidual(
        orders=orders,
        column_range_px=(0.0, rig.camera.width_px - 1.0),
        row_range_px=(0.0, rig.camera.height_px - 1.0),
        depth_range_mm=_around(rig.depth_range_mm, samples.depth_mm),
        wavelength_range_nm=_around(WAVELENGTH_RANGE_NM, samples.wavelength_nm),
        coefficients_px=((),) * len(orders),
    )
    if degree == 0:
        return blank
    terms = _terms(samples, degree)
    left = samples.column_px - grating_columns(rig, samples)
    rows = [_robust(_basis(rig, blank, samples.only(mine), terms), left[mine], samples.std_px[mine])
            for mine in (samples.order == m for m in orders)]  # fmt: skip
    return blank.model_copy(
        update={"degrees": terms, "coefficients_px": tuple(tuple(row.tolist()) for row in rows)}
    )


def correction_px(rig: Rig, residual: ColumnResidual, samples: OrderSamples) -> Floats:
    """What a correction adds to the columns of samples (px), shape (n,)."""
    found = np.zeros(len(samples))
    for m, nm in {(int(m), float(nm)) for m, nm in zip(samples.order, samples.wavelength_nm, strict=True)}:
        mine = (samples.order == m) & (samples.wavelength_nm == nm)
        y, x = (torch.as_tensor(axis, dtype=torch.float64) for axis in _pixels(rig, samples.only(mine)))
        depth = torch.as_tensor(samples.depth_mm[mine])
        more = residual_columns(residual, (x, y), depth, m, torch.tensor([nm], dtype=torch.float64))
        if more is not None:
            found[mine] = more[0].numpy()
    return found


def _folds(
    samples: OrderSamples, positions: Sequence[str], filters: Sequence[str]
) -> Iterator[tuple[str, Flags]]:
    """What to leave out, by name; only what leaves two of a kind."""
    for names, of in ((positions, samples.position), (filters, samples.filter)):
        values = np.unique(of)
        if len(values) > 2:
            yield from ((names[value], of == value) for value in values)
    rng = np.random.default_rng(0)
    # Whole tiles: neighbouring orders and filters of a tile share what is wrong there.
    yield (
        "a third of the tiles",
        np.isin(samples.tile, np.flatnonzero(rng.random(samples.tile.max() + 1) < 1 / 3)),
    )


def _terms(samples: OrderSamples, degree: int) -> tuple[tuple[int, int, int, int], ...]:
    """Degrees up to a total; in depth and wavelength fewer than there are positions and filters."""
    highest = (degree, degree, len(np.unique(samples.position)) - 1, len(np.unique(samples.filter)) - 1)
    axes = [range(min(degree, most) + 1) for most in highest]
    return tuple((i, j, k, n) for i, j, k, n in product(*axes) if i + j + k + n <= degree)


def _basis(
    rig: Rig, ranges: ColumnResidual, samples: OrderSamples, terms: tuple[tuple[int, int, int, int], ...]
) -> Floats:
    y, x = (torch.as_tensor(axis, dtype=torch.float64) for axis in _pixels(rig, samples))
    near, far = ranges.depth_range_mm
    axes = (
        (x, ranges.column_range_px),
        (y, ranges.row_range_px),
        (1 / torch.as_tensor(samples.depth_mm), (1 / far, 1 / near)),
        (torch.as_tensor(samples.wavelength_nm), ranges.wavelength_range_nm),
    )
    powers = [chebyshev(scaled(values, limits), MAX_DEGREE) for values, limits in axes]
    found = [powers[0][i] * powers[1][j] * powers[2][k] * powers[3][n] for i, j, k, n in terms]
    return torch.stack(found, 1).numpy()


def _pixels(rig: Rig, samples: OrderSamples) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    rows, columns = np.divmod(samples.pixel, rig.camera.width_px)
    return rows, columns


def _robust(basis: Floats, values: Floats, std: Floats) -> Floats:
    sigma = np.hypot(std, FLOOR_PX)
    found: Floats = np.zeros(basis.shape[1])
    for _ in range(ROUNDS):
        weight, _ = huber_weights(values - basis @ found, sigma, HUBER_SIGMAS)
        normal = (basis * weight[:, None]).T @ basis + np.eye(basis.shape[1]) / COEFFICIENT_STD_PX**2
        found = np.asarray(np.linalg.solve(normal, basis.T @ (weight * values)), float)
    return found


def _around(limits: tuple[float, float], values: Floats) -> tuple[float, float]:
    return min(limits[0], float(values.min())), max(limits[1], float(values.max()))


def _trimmed_rms(values: Floats) -> float:
    """Root mean square of the 99 % nearest to zero: lost peaks are not what a model is judged by."""
    if not len(values):
        raise CalibrationError(
            "Nothing is left to check the film's fit with. Capture more positions or filters."
        )
    size = np.sort(np.abs(values))
    return float(np.sqrt(np.mean(size[: max(int(0.99 * len(size)), 1)] ** 2)))
