"""Whether spectra of the LEDs agree: those of one picture with each other, and white with its parts.

An instrument may hand out the spectrum before, or one of another grid of wavelengths, and the projector a
picture late; a spectrum by itself looks right all the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.spectralon import COLOURS, EmissionReadings
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: How far a reading may be from the middle one of its picture, as a share of that one's peak, and in
#: deviations of the others.
APART, SIGMAS = 0.05, 8.0
#: Fewer readings than this have no middle one.
FEWEST = 3


def require_repeats(readings: EmissionReadings) -> None:
    """Raise `CalibrationError` where readings of one picture are of different light."""
    for colour in COLOURS:
        curves = readings.readings[colour]
        if colour == "black" or len(curves) < FEWEST:
            continue
        nm = np.array(curves[0].wavelengths_nm)
        stack = np.stack([curve.at(nm) for curve in curves])
        middle = np.median(stack, 0)
        away = np.abs(stack - middle)
        noise = float(robust_std(away.max(1)))
        limit = max(APART * float(middle.max()), SIGMAS * noise)
        odd = np.flatnonzero(away.max(1) > limit)
        if odd.size:
            share = float(away.max()) / max(float(middle.max()), 1e-300)
            raise CalibrationError(
                f"{odd.size} of {len(curves)} readings of {colour} are of other light than most: one is off"
                f" by {share:.0%} of the peak. Check that the projector shows one picture for as long as it"
                " is read, that the instrument hands out no earlier spectrum, and that no lamp is switched;"
                " then read the spectra again."
            )


def white_of_parts(
    white: Floats, leds: Floats, std: Floats
) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """How many times each LED is in white, and how far white is from that at most, with its deviation.

    ``white`` and ``std``, the deviation of white minus the sum, have shape (wavelengths,), ``leds`` (3,
    wavelengths). The distance is a share of white's peak.
    """
    parts, *_ = np.linalg.lstsq(leds.T, white, rcond=None)
    left = np.abs(white - parts @ leds)
    worst, peak = int(left.argmax()), max(float(white.max()), 1e-300)
    red, green, blue = (float(part) for part in parts)
    return (red, green, blue), (float(left[worst]) / peak, float(std[worst]) / peak)
