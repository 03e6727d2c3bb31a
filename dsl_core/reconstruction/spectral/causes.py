"""The parameters of the model that all probed pixels of a scan ask for together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import matters
from dsl_core.reconstruction.spectral.probing.pooled import pool
from dsl_core.reconstruction.spectral.probing.probe import LEADING, PRIOR_STD, Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS

Floats = NDArray[np.float64]

#: What matters of the place of the orders (px) and of their gains.
MOST_SHIFT_PX, MOST_GAIN = 0.035, 0.015
#: What matters of the light over the scan, and of curves by which colours disagree.
MOST_DRIFT, MOST_CURVES = 0.014, 0.015
#: Rms of a level that changes steadily from that of the start, relative to its change.
SINCE_START = 3**-0.5
#: Terms of the shift of an order over the picture: up to second degree.
_TERMS = 6


@dataclass(frozen=True)
class Causes:
    """The parameters of the model fitted to a whole scan, with deviations from the scatter over cells.

    ``shift_px`` (n, 2) of both orders at the probed pixels, their root mean square and its deviation;
    ``gain`` (2,) of both orders, with the deviations of their mean and difference; ``drift`` of the light
    from the first line to the last.
    """

    shift_px: Floats
    rms_px: float
    rms_std_px: float
    gain: Floats
    common_std: float
    difference_std: float
    drift: float
    drift_std: float

    @property
    def drifts(self) -> bool:
        """Whether the light has changed during the scan."""
        return matters(self.drift, self.drift_std, MOST_DRIFT)

    @property
    def unequal(self) -> bool:
        """Whether one order is brighter or darker against the other than calibrated."""
        plus, minus = self.gain
        return matters(plus - minus, self.difference_std, MOST_GAIN)

    @property
    def common_gain(self) -> float:
        """What both orders share, zero where they have changed in opposite ways.

        It is between them and the zero order, which other settings measure: whether the film or a response
        has changed, a scan alone cannot tell.
        """
        plus, minus = self.gain
        return float(np.sign(plus) * min(abs(plus), abs(minus))) if plus * minus > 0 else 0.0


def common_error(probe: Probe, causes: Causes) -> float:
    """Relative error of all reflectance that no pixel sees by itself: curves, and the level of the light.

    With what bands leave that are wide for the light of the rig.
    """
    curves = probe.curves
    off = curves is not None and matters(curves.whole_rms, curves.std, MOST_CURVES)
    share = curves.whole_rms if curves is not None and off else 0.0
    return float(np.hypot(share, SINCE_START * causes.drift if causes.drifts else 0.0))


def fit_causes(probe: Probe) -> Causes:
    """Fit all parameters at once; shifts are smooth over the picture, all others equal everywhere."""
    x, y = probe.place[:, 1], probe.place[:, 0]
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1)
    count, rest = len(x), LEADING - 2
    design = np.zeros((count, len(PARAMETERS), 2 * _TERMS + rest))
    design[:, 0, :_TERMS] = design[:, 1, _TERMS : 2 * _TERMS] = terms
    design[:, 2:LEADING, 2 * _TERMS :] = np.eye(rest)
    prior_std = np.r_[np.full(2 * _TERMS, PRIOR_STD[0]), PRIOR_STD[2:LEADING]]
    fit = pool(probe, design, prior_std)
    found, covariance, used = fit.values, fit.covariance, probe.sound
    shift = design[:, :2] @ found
    spread = np.einsum("npk,kl,npl->np", design[:, :2], covariance, design[:, :2])
    # Noise adds its own square to that of the shift.
    square, noise = float(np.mean(shift[used] ** 2)), float(np.mean(spread[used]))
    first = 2 * _TERMS
    pair = np.array([[0.5, 0.5], [1.0, -1.0]])
    common, difference = np.sqrt(
        np.diag(pair @ covariance[first : first + 2, first : first + 2] @ pair.T)
    ).tolist()
    return Causes(
        shift_px=shift,
        rms_px=float(np.sqrt(max(square - noise, 0.0))),
        rms_std_px=float(np.sqrt(noise / (2 * _TERMS))),
        gain=found[first : first + 2],
        common_std=common,
        difference_std=difference,
        drift=float(found[-1]),
        drift_std=float(np.sqrt(covariance[-1, -1])),
    )
