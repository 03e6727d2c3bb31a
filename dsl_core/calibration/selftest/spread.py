"""The colour cycle without trustworthy time stamps: how repeats spread at many exposures.

An exposure T started at any moment sees the k-th harmonic of a cycle f scaled by ``sinc(k f T)``, so the
variance of repeats is ``sum_k a_k sinc(k f T)**2``: it vanishes where T holds whole cycles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.cycle import HIGHEST_HZ, LOWEST_HZ, STEADY, Cycle
from dsl_core.calibration.selftest.readings import Readings
from dsl_core.model.calibration.selftest import Measured

Floats = NDArray[np.float64]

_HARMONICS = 8
#: Relative variance below which differences between exposures are not the cycle's.
_FLOOR = 1e-7
#: Mean log-likelihood that a higher frequency may lose against the best and count as equal.
_AS_GOOD = 0.1
#: A cycle must explain the spreads better than none by this mean log-likelihood.
_EXPLAINED = 0.3


def find_cycle_by_spread(readings: Readings, black_dn: float) -> Cycle:
    """The cycle in repeats at several exposures (rows of equal ``exposure_ms``), taken at any times."""
    exposures, spreads, counts = _spreads(readings, black_dn)
    modulation = float(np.sqrt(2 * spreads.max()))
    measured = Measured(value=modulation, std=modulation / np.sqrt(2 * max(int(counts.min()) - 1, 1)))
    if modulation < STEADY:
        return Cycle(None, measured)
    trial = np.geomspace(LOWEST_HZ, HIGHEST_HZ, 1 + round(np.log(HIGHEST_HZ / LOWEST_HZ) / _step(exposures)))
    cost = np.array([_cost(hz, exposures, spreads, counts) for hz in trial])
    none = _cost_of(np.full(spreads.shape, spreads.mean()), spreads, counts)
    low = cost <= cost.min() + _AS_GOOD
    low[1:-1] &= (cost[1:-1] <= cost[:-2]) & (cost[1:-1] <= cost[2:])
    if none - cost.min() < _EXPLAINED:
        return Cycle(None, measured)
    hz = float(trial[np.flatnonzero(low)[-1]])
    hz, std_hz = _refine(hz, exposures, spreads, counts)
    return Cycle(Measured(value=1000 / hz, std=1000 / hz**2 * std_hz), measured)


def _spreads(readings: Readings, black_dn: float) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Exposures (n,), relative variances (n,) of the channels together, and repeats (n,)."""
    exposures, group = np.unique(readings.exposure_ms, return_inverse=True)
    signal = (readings.mean_dn - black_dn) / readings.exposure_ms[:, None]
    signal = signal / signal.mean(0)
    spreads = np.array([signal[group == i].var(0, ddof=1).mean() for i in range(len(exposures))])
    return exposures, spreads + _FLOOR, np.bincount(group)


def _step(exposures: Floats) -> float:
    """Relative step of frequency that moves the phase of the longest exposure by a sixteenth of a cycle."""
    return float(1 / (16 * HIGHEST_HZ * exposures.max() / 1000))


def _cost(hz: float, exposures: Floats, spreads: Floats, counts: NDArray[np.int64]) -> float:
    """Mean negative log-likelihood of the spreads for the best non-negative powers of the harmonics."""
    from scipy.optimize import nnls

    order = np.arange(1, _HARMONICS + 1)
    design = np.sinc(exposures[:, None] / 1000 * hz * order) ** 2
    design = np.concatenate([design, np.full((len(exposures), 1), _FLOOR)], 1)
    model = np.maximum(spreads, spreads.mean() / 100)
    for _ in range(3):
        weight = np.sqrt(counts) / model
        found, _ = nnls(design * weight[:, None], spreads * weight)
        model = np.maximum(design @ found, _FLOOR)
    return _cost_of(model, spreads, counts)


def _cost_of(model: Floats, spreads: Floats, counts: NDArray[np.int64]) -> float:
    """Of a sample variance: a gamma distribution with half as many degrees of freedom as repeats."""
    share = (counts - 1) / 2
    return float((share * (np.log(model) + spreads / model)).sum() / share.sum())


def _refine(hz: float, exposures: Floats, spreads: Floats, counts: NDArray[np.int64]) -> tuple[float, float]:
    """Frequency of least cost; standard deviation by leaving out every eighth exposure, or by curvature."""
    step = hz * _step(exposures)
    trial = hz + step * np.linspace(-1.5, 1.5, 61)

    def costs(kept: NDArray[np.bool_]) -> Floats:
        return np.array([_cost(each, exposures[kept], spreads[kept], counts[kept]) for each in trial])

    groups = np.arange(len(exposures)) % 8
    parts = np.array([trial[costs(groups != i).argmin()] for i in range(8)])
    whole = costs(groups >= 0)
    likely = np.exp(-(whole - whole.min()) * (counts - 1).sum() / 2)
    mean = float(likely @ trial / likely.sum())
    width = np.sqrt(likely @ (trial - mean) ** 2 / likely.sum())
    return mean, float(max(parts.std() * np.sqrt(7), width, (trial[1] - trial[0]) / np.sqrt(12)))
