"""The colour cycle of a projector from short exposures at irregular times.

Red, green and blue LEDs flash one after the other, so a short exposure shows a colour that depends on when it
was taken. Harmonic least squares over trial frequencies (the periodogram of Lomb 1976 and Scargle 1982, with
several harmonics and a constant, and all channels together) finds the frequency; irregular times leave no
alias. A cycle at f is also one at f/2, f/3, ..., and its harmonics are at 2f, 3f, ...: of all frequencies
that explain the light about equally well, the highest is the cycle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.camera import Transfer
from dsl_core.calibration.selftest.readings import Readings, RegionSizes
from dsl_core.model.calibration.selftest import Beat, Measured

Floats = NDArray[np.float64]

#: Where colour cycles are looked for.
LOWEST_HZ, HIGHEST_HZ = 20.0, 300.0
#: Light that varies less than this share of its mean counts as steady.
STEADY = 0.01
_HARMONICS, _FINE_HARMONICS = 3, 12
#: Share of the variance that a cycle must explain; noise alone explains a quarter of 100 frames.
_EXPLAINED = 0.5
#: Residuals within this factor of the smallest, or this share of the variance, count as equally good.
_AS_GOOD, _AS_GOOD_SHARE = 1.5, 0.01
#: Gaps between time stamps must follow the waits asked for this closely to be believed.
_TRUSTED = 0.95
_CHUNK, _GROUPS = 1024, 8
_SPREAD_HARMONICS = 8
#: Relative variance below which differences between exposures are not the cycle's.
_SPREAD_FLOOR = 1e-7
#: Mean log-likelihood that a higher frequency may lose against the best and count as equal.
_SPREAD_AS_GOOD = 0.1
#: A cycle must explain the spreads better than none by this mean log-likelihood.
_SPREAD_EXPLAINED = 0.3


@dataclass(frozen=True)
class Cycle:
    """``period_ms`` is None when none was found; ``modulation`` is relative to the mean."""

    period_ms: Measured | None
    modulation: Measured

    @property
    def is_steady(self) -> bool:
        """Whether there is nothing to be found."""
        return self.period_ms is None and self.modulation.value < STEADY


def advised_exposures(period_ms: float, wanted_ms: tuple[float, ...]) -> tuple[float, ...]:
    """For each wanted exposure the nearest one that holds whole cycles, at least one.

    >>> [round(ms, 2) for ms in advised_exposures(1000 / 60, (160.0, 320.0, 3.0))]
    [166.67, 316.67, 16.67]
    """
    return tuple(max(1, round(wanted / period_ms)) * period_ms for wanted in wanted_ms)


def has_trusted_times(readings: Readings) -> bool:
    """Whether the time stamps rise and follow the waits between the frames."""
    steps = np.diff(readings.timestamp_s) * 1000
    if len(steps) < 3 or (steps <= 0).any():
        return False
    return bool(np.corrcoef(steps, readings.gap_ms[1:])[0, 1] > _TRUSTED)


def find_cycle(readings: Readings, black_dn: float) -> Cycle:
    """The cycle in short exposures of a white field at irregular, trusted times; see `Cycle`."""
    mean = readings.mean_dn.mean(0) - black_dn
    signal = (readings.mean_dn - black_dn) / mean - 1
    time_s = readings.timestamp_s - readings.timestamp_s.mean()
    spread = float(signal.std(0).max()) * np.sqrt(2)
    whole = float((signal**2).sum())
    hz, step = _coarse(time_s, signal, whole)
    residual = _residual(time_s, signal, np.array([hz]), _HARMONICS)[0]
    if spread < STEADY or residual > (1 - _EXPLAINED) * whole:
        # Without a cycle all that varies is noise, and what could hide in it is bounded by three times that.
        modulation = Measured(value=spread if spread >= STEADY else min(3 * spread, STEADY), std=spread)
        return Cycle(None, modulation)
    hz, std_hz, amplitude = _fine(time_s, signal, hz, step)
    period = Measured(value=1000 / hz, std=1000 / hz**2 * std_hz)
    return Cycle(period, amplitude)


def _coarse(time_s: Floats, signal: Floats, whole: float) -> tuple[float, float]:
    """The highest of the frequencies that explain the light about equally well, and the search's step."""
    step = 1 / (4 * _HARMONICS * max(np.ptp(time_s), 0.1))
    trial = np.arange(LOWEST_HZ, HIGHEST_HZ + step, step)
    residual = np.concatenate(
        [_residual(time_s, signal, trial[i : i + _CHUNK], _HARMONICS) for i in range(0, len(trial), _CHUNK)]
    )
    bound = _AS_GOOD * residual.min() + _AS_GOOD_SHARE * whole
    low = residual <= bound
    low[1:-1] &= (residual[1:-1] <= residual[:-2]) & (residual[1:-1] <= residual[2:])
    return float(trial[np.flatnonzero(low)[-1]]), step


def _fine(time_s: Floats, signal: Floats, hz: float, step: float) -> tuple[float, float, Measured]:
    """Frequency with standard deviation, and the amplitude of the channel that varies most.

    Steep edges leave residuals that repeat with the phase and are not noise, so the spread comes from fits
    that leave out every ``_GROUPS``-th frame in turn (the jackknife); a handful of them may agree by chance,
    so it is at least what the residuals say as noise.
    """
    harmonics = _worthwhile(time_s, signal, _nearest(time_s, signal, hz, step, _HARMONICS)[0])
    best, amplitude = _nearest(time_s, signal, hz, step, harmonics)
    parts = []
    for i in range(_GROUPS):
        kept = np.arange(len(time_s)) % _GROUPS != i
        parts.append(_nearest(time_s[kept], signal[kept], best, step / 2, harmonics))
    varied = np.array([*parts]).std(0) * np.sqrt(_GROUPS - 1)
    width = step / 10
    low, least, high = _residual(time_s, signal, best + width * np.arange(-1.0, 2.0), harmonics)
    spare = signal.size - _parameters(harmonics)
    noise = np.sqrt(2 * least / spare * width**2 / max(low + high - 2 * least, 1e-300))
    return best, float(max(varied[0], noise)), Measured(value=amplitude, std=float(varied[1]))


def _worthwhile(time_s: Floats, signal: Floats, hz: float) -> int:
    """The number of harmonics that the light justifies (Bayesian information criterion)."""
    most = max(1, min(_FINE_HARMONICS, len(time_s) // 7))
    scores = [
        signal.size * np.log(max(float(_residual(time_s, signal, np.array([hz]), count)[0]), 1e-12))
        + _parameters(count) * np.log(signal.size)
        for count in range(1, most + 1)
    ]
    return int(np.argmin(scores)) + 1


def _parameters(harmonics: int) -> int:
    """Of a wave in three channels, and its frequency."""
    return 3 * (2 * harmonics + 1) + 1


def _nearest(time_s: Floats, signal: Floats, hz: float, step: float, harmonics: int) -> tuple[float, float]:
    """Frequency of least residual within ``step`` of a start, and half the height of its wave."""
    from scipy.optimize import minimize_scalar

    def cost(trial: float) -> float:
        return float(_residual(time_s, signal, np.array([trial]), harmonics)[0])

    grid = hz + np.linspace(-step, step, 4 * harmonics + 1)
    near = grid[np.argmin(_residual(time_s, signal, grid, harmonics))]
    width = 2 * step / (4 * harmonics)
    bounds = (near - width, near + width)
    best = float(minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-7}).x)
    design = _design(time_s, np.array([best]), harmonics)[0]
    wave = design @ np.linalg.lstsq(design, signal, rcond=None)[0]
    return best, float(np.ptp(wave, axis=0).max()) / 2


def _residual(time_s: Floats, signal: Floats, trial_hz: Floats, harmonics: int) -> Floats:
    """Sum of squares that harmonics of each trial frequency leave, all channels together."""
    design = _design(time_s, trial_hz, harmonics)
    right = design.swapaxes(1, 2) @ signal
    normal = design.swapaxes(1, 2) @ design
    # A little ridge keeps frequencies solvable whose harmonics coincide at the times of the frames.
    normal += 1e-9 * len(time_s) * np.eye(normal.shape[-1])
    found = np.linalg.solve(normal, right)
    return np.asarray((signal**2).sum() - (found * right).sum((1, 2)))


def _design(time_s: Floats, trial_hz: Floats, harmonics: int) -> Floats:
    """Constant, cosines and sines at the times of the frames, (frequencies, frames, 1 + 2 * harmonics)."""
    first = np.exp(2j * np.pi * trial_hz[:, None] * time_s)[..., None]
    # Products give the harmonics in a fraction of the time that their cosines and sines take.
    waves = np.cumprod(np.broadcast_to(first, (*first.shape[:2], harmonics)), axis=-1)
    return np.concatenate([np.ones(first.shape), waves.real, waves.imag], axis=-1)


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
    low = cost <= cost.min() + _SPREAD_AS_GOOD
    low[1:-1] &= (cost[1:-1] <= cost[:-2]) & (cost[1:-1] <= cost[2:])
    if none - cost.min() < _SPREAD_EXPLAINED:
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
    return exposures, spreads + _SPREAD_FLOOR, np.bincount(group)


def _step(exposures: Floats) -> float:
    """Relative step of frequency that moves the phase of the longest exposure by a sixteenth of a cycle."""
    return float(1 / (16 * HIGHEST_HZ * exposures.max() / 1000))


def _cost(hz: float, exposures: Floats, spreads: Floats, counts: NDArray[np.int64]) -> float:
    """Mean negative log-likelihood of the spreads for the best non-negative powers of the harmonics."""
    from scipy.optimize import nnls

    order = np.arange(1, _SPREAD_HARMONICS + 1)
    design = np.sinc(exposures[:, None] / 1000 * hz * order) ** 2
    design = np.concatenate([design, np.full((len(exposures), 1), _SPREAD_FLOOR)], 1)
    model = np.maximum(spreads, spreads.mean() / 100)
    for _ in range(3):
        weight = np.sqrt(counts) / model
        found, _ = nnls(design * weight[:, None], spreads * weight)
        model = np.maximum(design @ found, _SPREAD_FLOOR)
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


def check_beats(
    readings: Readings, black_dn: float, transfer: Transfer, sizes: RegionSizes
) -> tuple[Beat, ...]:
    """A `Beat` for each exposure, in the order of first use."""
    exposures = list(dict.fromkeys(readings.exposure_ms.tolist()))
    return tuple(
        _beat(readings[readings.exposure_ms == exposure], exposure, black_dn, transfer, sizes)
        for exposure in exposures
    )


def _beat(
    repeats: Readings, exposure_ms: float, black_dn: float, transfer: Transfer, sizes: RegionSizes
) -> Beat:
    signal = repeats.mean_dn - black_dn
    mean = signal.mean(0)
    ratios = signal[:, [0, 2]] / signal[:, [1]]
    channels = 100 * signal.std(0, ddof=1) / mean
    spread = channels if sizes.is_monochrome else 100 * ratios.std(0, ddof=1) / ratios.mean(0)
    ratio = float(spread.max())
    # Relative standard deviation of a standard deviation of normal numbers.
    share = 1 / np.sqrt(2 * (len(repeats) - 1))
    measured = [Measured(value=float(value), std=float(share * value)) for value in channels]
    floor = 100 * transfer.mean_std(mean, sizes.pixels) / mean
    return Beat(
        exposure_ms=exposure_ms,
        channels_percent=(measured[0], measured[1], measured[2]),
        ratio_percent=Measured(value=ratio, std=share * ratio),
        floor_percent=float(floor.max()),
    )
