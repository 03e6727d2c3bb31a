"""The parameters of the model that all probed pixels of a scan ask for together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import matters
from dsl_core.reconstruction.spectral.evenness import fit_evenness
from dsl_core.reconstruction.spectral.probing.cell_sums import CellSums
from dsl_core.reconstruction.spectral.probing.curve_probe import BETWEEN
from dsl_core.reconstruction.spectral.probing.held_out import Hypothesis, explains_others
from dsl_core.reconstruction.spectral.probing.probe import LEADING, PRIOR_STD, Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS, SECOND

Floats = NDArray[np.float64]

#: What matters of the place of the orders (px) and of their gains.
MOST_SHIFT_PX, MOST_GAIN = 0.035, 0.015
#: What matters of the light of second orders, relative to that of the first.
MOST_SECOND = 0.015
#: What matters of the light over the scan, and of curves by which colours disagree.
MOST_DRIFT, MOST_CURVES = 0.014, 0.015
#: A larger drift is not one: white taken again would show it, and effects are taken to be linear.
LARGEST_DRIFT = 0.3
#: Rms of a level that changes steadily from that of the start, relative to its change.
SINCE_START = 3**-0.5
#: How much more first orders are off bright light of the calibration than they are off the zero order.
FROM_BRIGHT = 2.0
#: What a parameter is held at zero by.
NONE_STD = 1e-5
#: Where chi-squares of most pixels exceed one by more than this, frames lack something: a cause must explain
#: this share of it. Surfaces that light each other ask for gains and shifts as well, which explain little.
MOST_EXCESS, EXPLAINS = 0.5, 0.3
#: Terms of the shift of an order over the picture: up to second degree.
_TERMS = 6


@dataclass(frozen=True)
class Causes:
    """The parameters of the model fitted to a whole scan, with deviations from the scatter over cells.

    ``shift_px`` (n, 2) of both orders at the probed pixels; their mean (2,) and root mean square, with its
    deviation, over pixels that see the order: elsewhere the shift only continues what is seen; ``displaced``
    is whether what some parts of the picture ask of it explains the others;
    ``gain`` (2,) of both orders, with the deviations of their mean and difference; ``drift`` of the light
    from the first line to the last. A line lights a pixel by one order long before or after another does by
    the other, so that drift looks much as a difference of the gains: ``drift_alone`` and ``difference_alone``
    are each, with its deviation, where the other is none. ``second`` is light of second orders that the model
    lacks, relative to that of the first, with its deviation. ``explained`` are the shares of what frames lack
    that the shifts, the mean and the difference of the gains, drift and second orders explain; 1 where frames
    lack nothing.
    """

    shift_px: Floats
    mean_px: Floats
    rms_px: float
    rms_std_px: float
    displaced: bool
    gain: Floats
    common_std: float
    difference_std: float
    drift: float
    drift_std: float
    drift_alone: tuple[float, float]
    difference_alone: tuple[float, float]
    second: tuple[float, float] = (0.0, 0.0)
    explained: tuple[float, float, float, float, float] = (1.0, 1.0, 1.0, 1.0, 1.0)

    @property
    def brighter(self) -> bool:
        """Whether both orders are brighter, or darker, than calibrated: it explains what frames lack."""
        return self.explained[1] > EXPLAINS

    @property
    def drifts(self) -> bool:
        """Whether the light has changed during the scan.

        What frames ask for only together with gains that make up for it is an error of something else.
        """
        both = matters(self.drift, self.drift_std, MOST_DRIFT) and abs(self.drift) < LARGEST_DRIFT
        return both and matters(*self.drift_alone, MOST_DRIFT) and self.explained[3] > EXPLAINS

    @property
    def unequal(self) -> bool:
        """Whether one order is brighter against the other than calibrated; judged as `drifts` is."""
        plus, minus = self.gain
        both = matters(plus - minus, self.difference_std, MOST_GAIN)
        return both and matters(*self.difference_alone, MOST_GAIN) and self.explained[2] > EXPLAINS

    @property
    def seconds_differ(self) -> bool:
        """Whether second orders have other light than calibrated."""
        return matters(*self.second, MOST_SECOND) and self.explained[4] > EXPLAINS

    @property
    def common_gain(self) -> float:
        """What both orders share, zero where they have changed in opposite ways.

        It is between them and the zero order, which other settings measure: whether the film or a response
        has changed, a scan alone cannot tell.
        """
        plus, minus = self.gain
        return float(np.sign(plus) * min(abs(plus), abs(minus))) if plus * minus > 0 else 0.0


def beside_curves(probe: Probe, design: Floats, prior_std: Floats) -> Hypothesis:
    """Values of a design (n, p, k), the curves of camera and projector being off as colours say.

    Curves that are off seem to displace both orders; where colours disagree, only what curves do not explain
    as well tells of a place. Then what colours ask of the curves follows after the k values.
    """
    curves = probe.curves
    if curves is None or probe.with_curves is None or not matters(curves.whole_rms, curves.std, MOST_CURVES):
        return Hypothesis(CellSums.of(probe, design), prior_std)
    normal, score = probe.with_curves
    count, own, values = design.shape
    knot_std = np.full(score.shape[1] - own, curves.whole_rms / BETWEEN**0.5)
    wider = np.zeros((count, own + len(knot_std), values + len(knot_std)))
    wider[:, :own, :values] = design
    wider[:, own:, values:] = np.eye(len(knot_std))
    sums = CellSums.of(replace(probe, normal=normal, score=score), wider)
    return Hypothesis(sums, np.r_[prior_std, knot_std])


def common_error(probe: Probe, causes: Causes) -> float:
    """Relative error of all reflectance that no pixel sees by itself: curves, and light over time and frame.

    With what bands leave that are wide for the light of the rig.
    """
    curves = probe.curves
    off = curves is not None and matters(curves.whole_rms, curves.std, MOST_CURVES)
    share = curves.whole_rms if curves is not None and off else 0.0
    light = fit_evenness(probe)
    uneven = light.error if light is not None and light.matters else 0.0
    drift = SINCE_START * causes.drift if causes.drifts else 0.0
    return float(np.linalg.norm([share, uneven, drift, _response_error(causes)]))


def _response_error(causes: Causes) -> float:
    """Relative error of the light of both first orders by a response that the zero order shows to be off.

    The calibration measured brighter light than either: what they differ by, the first orders differ by as
    much again from that.
    """
    gain = causes.common_gain
    return FROM_BRIGHT * abs(gain) if matters(gain, causes.common_std, MOST_GAIN) and causes.brighter else 0.0


def fit_causes(probe: Probe) -> Causes:
    """Fit all parameters at once; shifts are smooth over the picture, all others equal everywhere."""
    x, y = probe.place[:, 1], probe.place[:, 0]
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1)
    count, rest = len(x), LEADING - 2
    design = np.zeros((count, len(PARAMETERS), 2 * _TERMS + rest))
    design[:, 0, :_TERMS] = design[:, 1, _TERMS : 2 * _TERMS] = terms
    design[:, 2:LEADING, 2 * _TERMS :] = np.eye(rest)
    first = 2 * _TERMS
    # Mean and difference of the gains, in the place of both.
    design[:, 2:4, first : first + 2] = [[1.0, 0.5], [1.0, -0.5]]
    prior_std = np.r_[np.full(first, PRIOR_STD[0]), PRIOR_STD[2:LEADING]]
    prior_std[first : first + 2] *= [0.5**0.5, 2**0.5]
    for order in np.flatnonzero(~probe.seen_orders):
        # One order has nothing to differ from; its lines light bands one after another, so that a drift looks
        # like a spectrum.
        prior_std[_TERMS * order : _TERMS * (order + 1)] = NONE_STD
        prior_std[[first + 1, -1]] = NONE_STD
    sums = CellSums.of(probe, design)
    fit = sums.fit(prior_std)
    displaced = explains_others(beside_curves(probe, design, prior_std), first)
    found, covariance = fit.values, fit.covariance
    shift = design[:, :2] @ found
    spread = np.einsum("npk,kl,npl->np", design[:, :2], covariance, design[:, :2])
    # Noise adds its own square to that of the shift.
    telling = _telling(probe)
    square, noise = float(np.sum(telling * shift**2)), float(np.sum(telling * spread))
    deviations = np.sqrt(np.diag(covariance))
    mean, apart = found[first : first + 2]

    def alone(kept: int, held: int) -> tuple[float, float]:
        held_std = prior_std.copy()
        held_std[held] = NONE_STD
        one = sums.fit(held_std)
        return float(one.values[kept]), float(np.sqrt(one.covariance[kept, kept]))

    drift, second = len(found) - 1, first + SECOND - 2
    groups = slice(0, first), *(slice(at, at + 1) for at in (first, first + 1, drift, second))
    shares = [_explained(probe, sums, prior_std, found, group) for group in groups]
    return Causes(
        shift_px=shift,
        mean_px=np.sum(telling * shift, 0) / np.maximum(telling.sum(0), 1e-12),
        rms_px=float(np.sqrt(max(square - noise, 0.0))),
        rms_std_px=float(np.sqrt(noise / (2 * _TERMS))),
        displaced=displaced and shares[0] > EXPLAINS,
        gain=np.array([mean + 0.5 * apart, mean - 0.5 * apart]),
        common_std=float(deviations[first]),
        difference_std=float(deviations[first + 1]),
        drift=float(found[drift]),
        drift_std=float(deviations[drift]),
        drift_alone=alone(drift, first + 1),
        difference_alone=alone(first + 1, drift),
        second=(float(found[second]), float(deviations[second])),
        explained=(shares[0], shares[1], shares[2], shares[3], shares[4]),
    )


def _explained(probe: Probe, sums: CellSums, prior_std: Floats, found: Floats, group: slice) -> float:
    """Share of what the frames of sound pixels lack that a group of the ``found`` values explains."""
    sound = probe.sound
    if probe.freedom is None or not sound.any():
        return 1.0
    excess, weight = probe.chi_square[sound] - 1, probe.weight[sound]
    if float(np.median(excess)) < MOST_EXCESS:
        return 1.0
    held_std = prior_std.copy()
    held_std[group] = NONE_STD
    fall = sums.falls(found) - sums.falls(sums.fit(held_std).values)
    return float(fall.sum()) / float(weight @ (excess * probe.freedom[sound]))


def _telling(probe: Probe) -> Floats:
    """Weights (n, 2), of sum 1, of what each pixel says of the shift of each order: at most as most do."""
    known = np.stack([probe.normal[:, order, order] for order in (0, 1)], 1) * probe.weight[:, None]
    known = np.where(probe.sound[:, None], known, 0.0)
    some = known[known > 0]
    limited = np.minimum(known, np.median(some) if some.size else 1.0)
    return np.asarray(limited / max(float(limited.sum()), 1e-12))
