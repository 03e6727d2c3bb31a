"""The camera's response from zero-order light through bandpass filters.

What a colour c sees through filter f is ``white_scale * integral of T_f E response_c``. With the response
known about, its logarithm changes by a smooth function g_c; filters whose transmission is not known exactly
share an unknown factor t_f among the colours, and all of them one of the drive level. White light without
filter, whose colours are known better than any curve, ties the functions together::

    log(seen / expected) = <g_c>_f + t_f + level + w,      log(white / expected) = <g_c> + w
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.spectral_nodes import NODES_NM, SMOOTHNESS
from dsl_core.calibration.orders.filter_check import MEASURED_NM, NOMINAL_NM
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
#: Prior deviation of a shift that all filters share, its rounds, the most that one moves it, and the step of
#: differences over it, nm.
SHIFT_STD_NM, SHIFT_ROUNDS, MOST_NM, SHIFT_STEP_NM = 5.0, 6, 3.0, 0.1
HATS = hat_functions(FINE_NM, NODES_NM)


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
    rig: Rig, samples: Sequence[BandSample], white: Floats, white_std: Floats, reflectance: Floats
) -> Rig:
    """The rig with its response and white scale refined, and their deviations.

    ``white`` (3,) is the zero order of white at unit shading, DN per ms, NaN for colours that the camera does
    not have: their curves stay as they are; ``reflectance`` is the target's at `FINE_NM`, as a share.
    """
    in_white = chain_response(rig, 0, FINE_NM).sum(1) * reflectance
    change = np.zeros((3, len(NODES_NM)))
    for _ in range(ROUNDS):
        solution = _solve(samples, _data(samples, in_white, white, white_std, change))
        change = solution.values[: 3 * len(NODES_NM)].reshape(3, -1)
    return _result(rig, solution, in_white[1] @ HATS / in_white[1].sum())


def shift_of_all(
    rig: Rig,
    samples: Sequence[BandSample],
    through: Sequence[Floats],
    white: Floats,
    white_std: Floats,
    reflectance: Floats,
) -> tuple[float, float]:
    """By how many nm all filters pass longer wavelengths than stated, against the LEDs' spectra; deviation.

    ``through`` are the filters' transmissions at `FINE_NM`; the rest is as for `fit_response`. On one flank
    of an LED's spectrum such a shift makes light brighter, on the other one darker, in all colours of the
    camera; a response that does so is not smooth. An error of the spectroradiometer's wavelengths looks
    alike. A response with edges of its own may look like a shift, too, but of another one at each LED: what
    the LEDs disagree by is part of the deviation.
    """
    by_led = chain_response(rig, 0, FINE_NM) * reflectance
    in_white = by_led.sum(1)
    change, shift_nm = np.zeros((3, len(NODES_NM))), 0.0
    for _ in range(SHIFT_ROUNDS):
        moved, further = (
            [replace(s, expected=in_white * _moved(t, nm)) for s, t in zip(samples, through, strict=True)]
            for nm in (shift_nm, shift_nm + SHIFT_STEP_NM)
        )
        here, there = (_data(each, in_white, white, white_std, change) for each in (moved, further))
        slope = (here.target - there.target) / SHIFT_STEP_NM
        target = here.target + slope * shift_nm
        solution = _solve(samples, here.besides(slope[:, None], target), [SHIFT_STD_NM])
        change = solution.values[: 3 * len(NODES_NM)].reshape(3, -1)
        shift_nm = float(np.clip(solution.values[-1], shift_nm - MOST_NM, shift_nm + MOST_NM))
    shares = _shares(by_led, samples, [_moved(t, shift_nm) for t in through], white)
    apart = here.besides(slope[:, None] * shares, target)
    excess = max(_disagreement(_solve(samples, apart, [SHIFT_STD_NM] * 3)), 1.0)
    centres = [MEASURED_NM if sample.measured_curve else NOMINAL_NM for sample in samples]
    own = solution.std[-1] * excess**0.5
    return shift_nm, float(np.hypot(own, np.linalg.norm(centres) / len(samples)))


@dataclass(frozen=True)
class _Data:
    """Equations of all samples and of white: design (n, unknowns), target and deviation (n,)."""

    design: Floats
    target: Floats
    std: Floats

    def besides(self, more: Floats, target: Floats) -> _Data:
        """The same with more unknowns (n, k) behind the others, and another target."""
        return _Data(np.concatenate([self.design, more], 1), target, self.std)


def _shares(
    by_led: Floats, samples: Sequence[BandSample], through: Sequence[Floats], white: Floats
) -> Floats:
    """Share of each LED in the light of every equation, (n, LEDs); ``by_led`` (3, LEDs, `FINE_NM`)."""
    light = [by_led[c] @ t for s, t in zip(samples, through, strict=True) for c in _usable(s)]
    light += [by_led[c].sum(1) for c in _seen_colours(white)]
    return np.array([each / max(each.sum(), 1e-300) for each in light])


def _disagreement(apart: SmoothSolution) -> float:
    """Reduced chi-square of the LEDs' own shifts, the last three unknowns, about their mean."""
    values, weight = apart.values[-3:], np.linalg.inv(apart.covariance[-3:, -3:])
    off = values - weight.sum(0) @ values / weight.sum()
    return float(off @ weight @ off / 2)


def _data(
    samples: Sequence[BandSample], in_white: Floats, white: Floats, white_std: Floats, change: Floats
) -> _Data:
    design, target, std = [], [], []
    for i, sample in enumerate(samples):
        for colour in _usable(sample):
            row, value = _equation(sample.expected[colour], sample.seen[colour], change[colour])
            design.append(_place(row, colour, len(samples), i))
            target.append(value)
            std.append(np.hypot(sample.std[colour] / sample.seen[colour], LEAST_STD))
    for colour in _seen_colours(white):
        row, value = _equation(in_white[colour], white[colour], change[colour])
        design.append(_place(row, colour, len(samples), None))
        target.append(value)
        std.append(np.hypot(white_std[colour] / white[colour], LEAST_STD))
    return _Data(np.array(design), np.array(target), np.array(std))


def _solve(samples: Sequence[BandSample], data: _Data, more_std: Sequence[float] = ()) -> SmoothSolution:
    """The most likely unknowns; ``more_std`` are prior deviations of those behind the usual ones."""
    known = [MEASURED_STD if sample.measured_curve else NOMINAL_STD for sample in samples]
    return solve_smooth(
        Equations.of(data.design, data.target, data.std),
        [SmoothPrior(NODES_NM, LEVEL_STD, RISE_STD)] * 3,
        [*known, DRIVE_STD, SCALE_STD, *more_std],
        **SMOOTHNESS,
    )


def _moved(through: Floats, shift_nm: float) -> Floats:
    """A transmission at `FINE_NM` whose band is so many nm further to the red."""
    return np.interp(FINE_NM - shift_nm, FINE_NM, through)


def _seen_colours(white: Floats) -> list[int]:
    """The colours that the camera has, of the zero order of white (3,)."""
    return np.flatnonzero(np.isfinite(white)).tolist()


def _usable(sample: BandSample) -> list[int]:
    brightest = np.nanmax(sample.seen, initial=0.0)
    return [
        c
        for c in range(3)
        if np.isfinite(sample.std[c])
        and sample.seen[c] > LEAST_SHARE * brightest
        and sample.expected[c].sum() > 0
    ]


def _equation(expected: Floats, seen: float, change: Floats) -> tuple[Floats, float]:
    """Weights of the function's nodes in a signal, and the value of their sum that would explain it."""
    light = expected * np.exp(HATS @ change)
    row = light @ HATS / light.sum()
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
