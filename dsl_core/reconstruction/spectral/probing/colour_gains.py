"""Whether the camera weighs its colours as when it was calibrated: white balance does not, if it is on.

Gains of red and blue against green show where two colours see the same wavelengths: there one spectrum has to
explain both. What all colours share looks like another reflectance. Curves that are off by a few percent look
a little like gains; how much is in the deviation. Only blue against red is told: where spectra are less
smooth than the prior takes them for, green seems to differ from both, by 16 % in a fine scan of a Color
Checker.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.spectral.probing.curve_probe import of_all_pixels

Floats = NDArray[np.float64]

#: By how much each curve of a colour may be off at any wavelength (relative standard deviation).
CURVE_STD = 0.03
#: What other parameters and curves cannot know of gains before a scan is seen.
GAIN_STD = 0.5
#: Gains that are known no better say nothing.
KNOWN_STD = 0.05
COLOURS, RED, BLUE = 3, 0, 2
#: What gains of red and blue are multiplied by.
APART = np.array([-1.0, 1.0])


class ColourGains(NamedTuple):
    """Gains of red and blue over that of green, less one, and their covariance (2, 2)."""

    red: float
    blue: float
    covariance: Floats

    @property
    def apart(self) -> tuple[float, float]:
        """How far blue is from red, and the standard deviation."""
        return self.blue - self.red, float(np.sqrt(APART @ self.covariance @ APART))


def colour_gains(normal: Floats, score: Floats, weight: Floats, prior_std: Floats) -> ColourGains | None:
    """Gains by the equations of pixels (n, p + c, p + c) and (n, p + c) without the spectrum.

    First come p other parameters, with priors (p,), then the c knots of the curves, red before green before
    blue. None where the pixels do not tell.
    """
    information, asked = of_all_pixels(normal, score, weight)
    others = len(prior_std)
    knots = (len(asked) - others) // COLOURS
    of_gains = np.zeros((len(asked), 2))
    for index, colour in enumerate((RED, BLUE)):
        of_gains[others + colour * knots : others + (colour + 1) * knots, index] = 1.0
    prior = np.r_[1 / GAIN_STD**2, 1 / GAIN_STD**2, 1 / prior_std**2, np.full(COLOURS * knots, CURVE_STD**-2)]
    whole = np.concatenate([of_gains, np.eye(len(asked))], 1)
    covariance = np.linalg.inv(whole.T @ information @ whole + np.diag(prior))
    found = covariance @ (whole.T @ asked)
    gains = ColourGains(float(found[0]), float(found[1]), covariance[:2, :2])
    return gains if np.isfinite(found[:2]).all() and gains.apart[1] <= KNOWN_STD else None
