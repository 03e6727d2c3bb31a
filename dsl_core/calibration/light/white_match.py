"""A rig made to give the white signals that were measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.light.spectral_refinement import FINE_NM, NODES_NM
from dsl_core.model.calibration.spectralon import WhiteSignals
from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve

Floats = NDArray[np.float64]

#: Signals of a channel under an LED with a larger relative deviation say nothing of the response's shape.
TRUSTED = 0.02
#: Curvature against which a level counts: small, so that only the shape is kept smooth.
LEVEL_WEIGHT = 1e-4
ITERATIONS = 30


def match_whites(rig: Rig, white: WhiteSignals, reflectance: SpectralCurve) -> Rig:
    """The rig with responses and white scale that reproduce white signals, nothing else changed.

    Each response is multiplied by the smoothest factor (least squared gradient of its logarithm) that gives
    the channel's signal under every LED; the three responses keep the sum of their integrals, and the white
    scale takes the rest. A rig that gives the signals already comes back as it is.
    """
    emission = np.stack([curve.at(FINE_NM) for curve in rig.emission]) * reflectance.at(FINE_NM)
    start = np.stack([curve.at(FINE_NM) for curve in rig.response])
    matched = np.stack(
        [
            _matched(start[c], rig.white_scale * emission, white.array[c], np.array(white.rel_std[c]))
            for c in range(3)
        ]
    )
    scale = float(matched.sum() / start.sum())
    red, green, blue = (SpectralCurve.of(FINE_NM, curve / scale) for curve in matched)
    response: Rgb = (red, green, blue)
    # Where white is not the sum of its LEDs, by noise or else, no signal is better known than that.
    std = float(np.hypot(_white_std(white).mean(), _rms(np.array(white.white_over_sum) - 1)))
    return rig.model_copy(
        update={"response": response, "white_scale": rig.white_scale * scale, "white_scale_rel_std": std}
    )


def _white_std(white: WhiteSignals) -> Floats:
    """Relative deviation of each channel's signal under all LEDs, shape (3,)."""
    spread = white.array * np.array(white.rel_std)
    return np.asarray(np.linalg.norm(spread, axis=1) / white.array.sum(1))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _matched(response: Floats, lights: Floats, wanted: Floats, rel_std: Floats) -> Floats:
    """A response (wavelengths,) times the smoothest factor that gives ``wanted`` under ``lights``."""
    hats = np.stack([np.interp(FINE_NM, NODES_NM, unit) for unit in np.eye(len(NODES_NM))])
    used = (wanted > 0) & (rel_std < TRUSTED) & (lights @ response > 0)
    gradient = np.diff(np.eye(len(NODES_NM)), axis=0)
    stiff = np.linalg.inv(gradient.T @ gradient + LEVEL_WEIGHT * np.eye(len(NODES_NM)))
    factor = np.zeros(len(NODES_NM))
    for _ in range(ITERATIONS):
        density = lights[used] * (response * np.exp(factor @ hats))
        signal = density.sum(1)
        miss = np.log(wanted[used] / signal)
        if np.abs(miss).max(initial=0.0) < 1e-12:
            break
        share = density @ hats.T / signal[:, None]
        # The smoothest factor that meets all signals to first order, seen from the start.
        factor = stiff @ share.T @ np.linalg.solve(share @ stiff @ share.T, miss + share @ factor)
    return np.asarray(response * np.exp(factor @ hats))
