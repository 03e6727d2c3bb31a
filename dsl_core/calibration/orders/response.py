"""The camera's response from zero-order light through bandpass filters.

What a colour c sees through filter f is ``white_scale * integral of T_f E response_c``. With the response
known about, its logarithm changes by a smooth function g_c; filters whose transmission is not known exactly
share an unknown factor t_f among the colours, and all of them one of the drive level. White light without
filter, whose colours are known better than any curve, ties the functions together::

    log(seen / expected) = <g_c>_f + t_f + level + w,      log(white / expected) = <g_c> + w
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.spectral_nodes import NODES_NM, SMOOTHNESS
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import FINE_NM
from dsl_core.optics.spectra import chain_response
from dsl_core.solve.smooth_functions import (
    Equations,
    SmoothPrior,
    SmoothSolution,
    hat_functions,
    solve_smooth,
)

Floats = NDArray[np.float64]

#: Prior deviations of each function's level and rise; of a measured and a nominal transmission; of the
#: drive level; of the white scale.
LEVEL_STD, RISE_STD = 0.1, 0.1
MEASURED_STD, NOMINAL_STD, DRIVE_STD, SCALE_STD = 0.005, 0.15, 0.01, 0.3
#: Least relative deviation of a signal, and the share of the brightest colour below which one is not used.
LEAST_STD, LEAST_SHARE = 1e-3, 0.01
ROUNDS = 3


@dataclass(frozen=True)
class BandSample:
    """Zero order (3,) at unit shading through one filter, DN per ms, its deviation, and what was expected.

    ``expected`` (3, `FINE_NM`) is per nm of the rig so far, target included.
    """

    seen: Floats
    std: Floats
    expected: Floats
    measured_curve: bool


def fit_response(
    rig: Rig, samples: Sequence[BandSample], white: Floats, white_std: Floats, reflectance: float
) -> Rig:
    """The rig with its response and white scale refined, and their deviations.

    ``white`` (3,) is the zero order of white at unit shading, DN per ms.
    """
    nm = FINE_NM
    hats = hat_functions(nm, NODES_NM)
    in_white = chain_response(rig, 0, nm).sum(1) * reflectance
    change = np.zeros((3, len(NODES_NM)))
    for _ in range(ROUNDS):
        design, target, std = [], [], []
        for i, sample in enumerate(samples):
            for colour in _usable(sample):
                row, value = _equation(sample.expected[colour], sample.seen[colour], hats, change[colour])
                design.append(_place(row, colour, len(samples), i))
                target.append(value)
                std.append(np.hypot(sample.std[colour] / sample.seen[colour], LEAST_STD))
        for colour in range(3):
            row, value = _equation(in_white[colour], white[colour], hats, change[colour])
            design.append(_place(row, colour, len(samples), None))
            target.append(value)
            std.append(np.hypot(white_std[colour] / white[colour], LEAST_STD))
        known = [MEASURED_STD if sample.measured_curve else NOMINAL_STD for sample in samples]
        solution = solve_smooth(
            Equations.of(np.array(design), np.array(target), np.array(std)),
            [SmoothPrior(NODES_NM, LEVEL_STD, RISE_STD)] * 3,
            [*known, DRIVE_STD, SCALE_STD],
            **SMOOTHNESS,
        )
        change = solution.values[: 3 * len(NODES_NM)].reshape(3, -1)
    return _result(rig, solution, in_white[1] @ hats / in_white[1].sum())


def _usable(sample: BandSample) -> list[int]:
    brightest = np.nanmax(sample.seen, initial=0.0)
    return [
        c
        for c in range(3)
        if np.isfinite(sample.std[c])
        and sample.seen[c] > LEAST_SHARE * brightest
        and sample.expected[c].sum() > 0
    ]


def _equation(expected: Floats, seen: float, hats: Floats, change: Floats) -> tuple[Floats, float]:
    """Weights of the function's nodes in a signal, and the value of their sum that would explain it."""
    light = expected * np.exp(hats @ change)
    row = light @ hats / light.sum()
    return row, float(np.log(seen / light.sum()) + row @ change)


def _place(row: Floats, colour: int, filters: int, index: int | None) -> Floats:
    """The row among all unknowns: three functions, filters' factors, drive level, white scale."""
    n = len(NODES_NM)
    full = np.zeros(3 * n + filters + 2)
    full[colour * n : (colour + 1) * n] = row
    full[-1] = 1
    if index is not None:
        full[3 * n + index] = full[-2] = 1
    return full


def _result(rig: Rig, solution: SmoothSolution, green: Floats) -> Rig:
    """Fix the scale: what white light makes green see stays, and the white scale takes the rest."""
    n, count = len(NODES_NM), len(solution.values)
    mean = np.zeros(count)
    mean[n : 2 * n] = green
    shift = np.eye(count)
    shift[: 3 * n] -= mean
    shift[-1] += mean
    values, covariance = shift @ solution.values, shift @ solution.covariance @ shift.T
    std = np.sqrt(np.diag(covariance).clip(min=0))
    response = tuple(
        _refined(curve, values[c * n : (c + 1) * n], std[c * n : (c + 1) * n])
        for c, curve in enumerate(rig.response)
    )
    scale = rig.white_scale * float(np.exp(values[-1]))
    return rig.model_copy(
        update={"response": response, "white_scale": scale, "white_scale_rel_std": float(std[-1])}
    )


def _refined(curve: SpectralCurve, change: Floats, std: Floats) -> SpectralCurve:
    nm = np.union1d(curve.wavelengths_nm, NODES_NM)
    values = curve.at(nm) * np.exp(np.interp(nm, NODES_NM, change))
    spread = np.abs(values) * np.interp(nm, NODES_NM, std)
    return SpectralCurve.of(nm, values, curve.unit, spread)
