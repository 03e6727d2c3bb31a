"""How filters' bands shift with the angle of view, from the zero order in cells of the image.

On a flank of an LED's spectrum a shift of some nm changes the light through a filter by tens of percent, so
that the sides of the picture are darker or brighter than its middle, compared with white without a filter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.orders.order_light import FilterLight
from dsl_core.calibration.orders.order_place import PlanePixels
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import (
    ANGLE_STD,
    FINE_NM,
    FilterAngle,
    relative_shift,
    shift_slopes,
    shift_terms,
    through_filter,
)
from dsl_core.optics.spectra import chain_response
from dsl_core.solve.robust import huber_weights

Floats = NDArray[np.float64]

#: Shifts at which the light through a filter is computed; between them it is interpolated.
SHIFTS = np.linspace(-0.04, 0.02, 121)
#: Least relative deviation of a cell: unevenness that filters add, and what a cell's extent leaves.
LEAST_STD = 3e-3
#: Colours dimmer than this share of the brightest one are not used.
LEAST_SHARE = 0.03
#: Relative deviation of c by curves of camera and LEDs that are off by some percent.
CURVES_STD = 0.05
HUBER_SIGMAS, ROUNDS = 2.5, 12


def cell_terms(rig: Rig, pixels: PlanePixels, index: NDArray[np.int64]) -> Floats:
    """Mean `shift_terms` of each cell, (cells, 3); ``index`` (P,) are flat indices of the pixels.

    Cells without pixels have zeros.
    """
    terms = shift_terms(rig, index)
    count = np.maximum(np.bincount(pixels.cell, minlength=pixels.cells), 1)
    return np.stack([np.bincount(pixels.cell, each, pixels.cells) / count for each in terms.T], 1)


def angle_of_view(
    rig: Rig,
    curves: Sequence[SpectralCurve],
    lights: Sequence[FilterLight],
    white: tuple[Floats, Floats],
    terms: Floats,
) -> FilterAngle:
    """The shift that explains the zero order through filters by cell, robustly.

    ``white`` is the zero order without a filter with its deviation, (3, cells) each; ``terms`` (cells, 3) as
    of `cell_terms`.
    """
    seen = [_seen(light, white) for light in lights]
    tables = [_table(rig, curve) for curve in curves]
    values = np.zeros(3)
    information = np.diag(ANGLE_STD**-2.0)
    for _ in range(ROUNDS):
        shift, slopes = relative_shift(terms, values), shift_slopes(terms, values)
        rows = [_rows(*each, table, shift, slopes) for each, table in zip(seen, tables, strict=True)]
        residual, design, sigma = (np.concatenate(part) for part in zip(*rows, strict=True))
        if len(residual) == 0:
            break
        weight, _ = huber_weights(residual, sigma, HUBER_SIGMAS)
        information = (design * weight[:, None]).T @ design + np.diag(ANGLE_STD**-2.0)
        step = np.linalg.solve(information, design.T @ (weight * residual) - values / ANGLE_STD**2)
        values = values + np.clip(step, -0.5 * ANGLE_STD, 0.5 * ANGLE_STD)
        if np.abs(step / ANGLE_STD).max() < 1e-4:
            break
    std = np.sqrt(np.diag(np.linalg.inv(information)))
    c_std, a_std, b_std = np.hypot(std, CURVES_STD * np.abs(values)).tolist()
    c, a, b = values.tolist()
    return FilterAngle((c, a, b), (c_std, a_std, b_std))


def _seen(light: FilterLight, white: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Logarithm of a filter's zero order over that of white, and its deviation, (3, cells)."""
    good = (light.cells > 0) & (white[0] > 0)
    bright = np.nan_to_num(light.zero) > LEAST_SHARE * np.nanmax(light.zero, initial=0.0)
    good &= bright[:, None]
    value = np.log(np.where(good, light.cells, 1.0) / np.where(good, white[0], 1.0))
    relative = [
        np.where(good, std, 0.0) / np.where(good, mean, 1.0)
        for mean, std in ((light.cells, light.cells_std), white)
    ]
    return value, np.where(good, np.sqrt(relative[0] ** 2 + relative[1] ** 2 + LEAST_STD**2), np.inf)


def _table(rig: Rig, curve: SpectralCurve) -> Floats:
    """Logarithm of the light through a filter at `SHIFTS`, (3, shifts)."""
    white = chain_response(rig, 0, FINE_NM).sum(1)
    light = np.stack([white @ through_filter(curve, shift[None]) for shift in SHIFTS], 1)
    return np.asarray(np.log(np.maximum(light, 1e-12)))


def _rows(
    value: Floats, std: Floats, table: Floats, shift: Floats, slopes: Floats
) -> tuple[Floats, Floats, Floats]:
    """Residuals (n,), their slopes by c, a and b (n, 3), and deviations (n,), of all colours of a filter.

    Each colour's mean is taken out: how bright a filter is says nothing of angles.
    """
    parts: list[tuple[Floats, Floats, Floats]] = [(np.empty(0), np.empty((0, 3)), np.empty(0))]
    for colour in range(3):
        use = np.isfinite(std[colour])
        if use.sum() < 3:
            continue
        model = np.interp(shift[use], SHIFTS, table[colour])
        steep = np.interp(shift[use], SHIFTS, np.gradient(table[colour], SHIFTS))
        weight = std[colour, use] ** -2
        residual = value[colour, use] - model
        design = steep[:, None] * slopes[use]
        parts.append(
            (
                residual - np.average(residual, weights=weight),
                design - np.average(design, 0, weight),
                std[colour, use],
            )
        )
    residual, design, sigma = (np.concatenate(part) for part in zip(*parts, strict=True))
    return residual, design, sigma
