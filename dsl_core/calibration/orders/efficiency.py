"""Efficiency of a diffraction order over wavelength, from its light through bandpass filters.

The light of the order relative to the zero order is the mean of the efficiency over what filter, LEDs and
camera let pass, not its value at the filter's centre. The logarithm of the efficiency is a smooth function,
a straight line and a Gaussian process, as smooth as the data say (`solve.smooth_functions`), or as films are
where few filters say nothing of it; the means are linearised around the curve itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.spectral_nodes import NODES_NM
from dsl_core.errors import CalibrationError
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import FINE_NM
from dsl_core.solve.smooth_functions import Equations, SmoothPrior, hat_functions, solve_smooth

Floats = NDArray[np.float64]

#: Prior deviations of the logarithm's level and of its rise over all nodes.
LEVEL_STD, RISE_STD = 4.0, 2.0
AMPLITUDES, LENGTHS, NOISE_FACTORS = (
    (0.003, 0.01, 0.03, 0.1, 0.3),
    (30.0, 60.0, 120.0, 240.0),
    (1.0, 1.4, 2.0, 4.0, 8.0),
)
MIN_SAMPLES, ROUNDS = 2, 4
#: Fewer filters than this, so many nm apart, do not say how a curve bends between them: it may bend as those
#: of films do.
FEW, APART_NM = 5, 5.0
FEW_AMPLITUDE, FEW_LENGTH_NM = 0.2, 75.0
#: Least relative deviation of a ratio: nonlinearity of a camera and what scatters inside it.
LEAST_STD = 8e-4
#: An order stands out from the noise when its ratio is so many deviations above nothing.
STANDS_OUT = 3.0
#: Second orders of a film's two sides may differ by this share where only one of them was seen.
SIDES_STD = 0.2


@dataclass(frozen=True)
class RatioSample:
    """Ratio of an order to the zero order, its deviation, and the light it averages over at `FINE_NM`."""

    ratio: float
    std: float
    light: Floats


@dataclass(frozen=True)
class EfficiencyFit:
    """Efficiency with deviation, and the factor by which samples scatter more than they state."""

    curve: SpectralCurve
    misfit: float


def require_both_orders(samples: Mapping[int, Sequence[RatioSample]]) -> None:
    """Raise `CalibrationError` where filters show one first order well and the other not at all."""
    seen = {order: len(_usable(each)) for order, each in samples.items()}
    for order, count in seen.items():
        if count == 0 and seen[-order] >= MIN_SAMPLES:
            raise CalibrationError(
                f"Order {order:+d} was found through none of the filters, order {-order:+d} through"
                f" {seen[-order]}: the film sends no light into order {order:+d}, or sends it beyond the"
                " projector's frame. Calibration needs both first orders. Use a film that has them, or place"
                " the target in the middle of the projected picture."
            )


def _usable(samples: Sequence[RatioSample]) -> list[RatioSample]:
    return [each for each in samples if np.isfinite(each.std) and each.ratio > STANDS_OUT * each.std]


def fit_efficiency(order: int, samples: Sequence[RatioSample]) -> EfficiencyFit:
    """Smooth efficiency of one order; raises `CalibrationError` with fewer than two usable samples."""
    used = _usable(samples)
    if len({round(_centre(s)) for s in used}) < MIN_SAMPLES:
        raise CalibrationError(
            f"Order {order:+d} was found through {len(used)} filters; {MIN_SAMPLES} of different wavelengths"
            " are needed. Check that the film is mounted, place the target where the order's light reaches"
            " it, and use more filters."
        )
    hats = hat_functions(FINE_NM, NODES_NM)
    light = np.stack([s.light / s.light.sum() for s in used])
    ratio = np.array([s.ratio for s in used])
    std = np.hypot([s.std / s.ratio for s in used], LEAST_STD)
    trend = np.polynomial.Polynomial.fit(light @ FINE_NM, np.log(ratio), 1, w=1 / std)
    log_curve = trend(NODES_NM)
    is_few = _apart(used) < FEW
    for _ in range(ROUNDS):
        value = np.exp(hats @ log_curve)
        mean = light @ value
        design = (light * value) @ hats / mean[:, None]
        level = float(log_curve.mean())
        target = np.log(ratio / mean) + design @ (log_curve - level)
        solution = solve_smooth(
            Equations.of(design, target, std),
            [SmoothPrior(NODES_NM, LEVEL_STD, RISE_STD)],
            amplitudes=(FEW_AMPLITUDE,) if is_few else AMPLITUDES,
            lengths=(FEW_LENGTH_NM,) if is_few else LENGTHS,
            noise_factors=NOISE_FACTORS,
        )
        log_curve = solution.values + level
    return EfficiencyFit(_curve(log_curve, solution.std), solution.noise_factor)


def _curve(log_values: Floats, log_std: Floats) -> SpectralCurve:
    """The curve on a grid so fine that straight lines between its points lose nothing."""
    from scipy.interpolate import CubicSpline

    nm = np.arange(NODES_NM[0], NODES_NM[-1] + 1, 2.0)
    values = np.exp(CubicSpline(NODES_NM, log_values)(nm))
    std = values * np.interp(nm, NODES_NM, log_std)
    return SpectralCurve.of(nm, values, std=std)


def _centre(sample: RatioSample) -> float:
    return float((sample.light * FINE_NM).sum() / sample.light.sum())


def _apart(samples: Sequence[RatioSample]) -> int:
    """How many filters differ in their centres; colours of one filter do by a nanometre or two."""
    count, last_nm = 0, -np.inf
    for centre_nm in sorted(_centre(sample) for sample in samples):
        if centre_nm - last_nm >= APART_NM:
            count, last_nm = count + 1, centre_nm
    return count


def second_order_share(
    samples: Sequence[tuple[float, float, float]],
) -> tuple[float, float]:
    """Mean share of second in first orders, and its deviation, from (ratio, deviation, first-order ratio).

    Without any sample the share is zero and its deviation infinite.
    """
    used = np.array([s for s in samples if np.isfinite(s[1]) and s[2] > 0]).reshape(-1, 3)
    if not len(used):
        return 0.0, np.inf
    share, weight = used[:, 0] / used[:, 2], (used[:, 2] / used[:, 1]) ** 2
    mean = float((weight * share).sum() / weight.sum())
    chi = float((weight * (share - mean) ** 2).sum()) / max(len(used) - 1, 1)
    return max(mean, 0.0), float(np.sqrt(max(chi, 1.0) / weight.sum()))


def shares_of_sides(seen: Mapping[int, tuple[float, float]]) -> dict[int, tuple[float, float]]:
    """Both `second_order_share` with deviations by first order, +1 and -1; none where neither side shows any.

    A film need not send as much to one side as to the other; of a side that shows none, the other says most.
    """
    found = {}
    for order, (share, std) in seen.items():
        other, other_std = seen[-order]
        if np.isfinite(std):
            found[order] = share, std
        elif np.isfinite(other_std):
            found[order] = other, float(np.hypot(other_std, SIDES_STD * other))
    return found


def second_order_curve(first: SpectralCurve, share: float, share_std: float) -> SpectralCurve:
    """Efficiency of a second order that is a share of the first, with the deviations of both."""
    values = np.array(first.values)
    std = np.hypot(share * np.array(first.std), share_std * values)
    return SpectralCurve.of(first.wavelengths_nm, share * values, std=std)
