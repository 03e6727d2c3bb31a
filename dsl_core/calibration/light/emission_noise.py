"""Noise of spectra that were read once, by what white has beyond red, green and blue.

Second differences of a spectrum see its noise where it is dark, which is most of it, and only as far as the
noise of neighbouring wavelengths is independent. White minus its parts contains the noise of every
wavelength, and nothing of the LEDs.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.calibration.spectralon import LightColour

Floats = NDArray[np.float64]
Spectra = Mapping[LightColour, Floats]

#: Rounds in which the variance is fitted to squares, whose scatter follows from it.
ROUNDS = 8
#: Wavelengths farther apart have independent noise: instruments are not that blurred.
FARTHEST_NM = 15.0
#: A correlation below this many of its own deviations is none.
LEAST_SIGMAS = 2.0
#: Noise is no smaller than this share of the peak.
FLOOR = 1e-9


def noise_of_single(
    nm: Floats,
    mean: Spectra,
    variance: Spectra,
    parts: tuple[float, float, float],
    single: Collection[LightColour],
) -> dict[LightColour, Floats]:
    """The variances (wavelengths,) of all spectra, larger for those of a ``single`` reading if need be.

    ``mean`` are the spectra as read, ``parts`` how many times red, green and blue are in white. A single
    reading has its variance times a factor of at least one and a share of its signal, as photon noise has,
    and all that times the number of neighbours whose noise is alike: averaging over these helps nothing.
    """
    if not single:
        return dict(variance)
    factor: dict[LightColour, float] = {"white": 1.0, "black": sum(parts) - 1.0}
    factor |= {"red": -parts[0], "green": -parts[1], "blue": -parts[2]}
    left = sum((factor[c] * mean[c] for c in factor), np.zeros(len(nm)))
    light = {c: np.maximum(mean[c], 0.0) for c in single}
    known, rough, photons = (
        sum((factor[c] ** 2 * values[c] for c in chosen), np.zeros(len(nm)))
        for values, chosen in ((variance, list(factor)), (variance, single), (light, single))
    )
    floor = (FLOOR * float(np.abs(mean["white"]).max())) ** 2
    more, share = _fitted(left**2, known, rough, photons, floor)
    stated = known + more * rough + share * photons
    alike = _alike(nm, left / np.sqrt(np.maximum(stated, floor)))
    raised = {c: alike * ((1 + more) * variance[c] + share * light[c]) for c in single}
    return {**variance, **raised}


def _fitted(
    squares: Floats, known: Floats, rough: Floats, light: Floats, floor: float
) -> tuple[float, float]:
    """Shares (not negative) of ``rough`` and ``light`` that ``squares`` have on average beyond ``known``."""
    from scipy.optimize import nnls

    shares = np.zeros(2)
    for _ in range(ROUNDS):
        # Squares scatter by as much as they are on average.
        weight = 1 / np.maximum(known + shares[0] * rough + shares[1] * light, floor)
        size = max(float((weight * rough).max()), 1e-300), max(float((weight * light).max()), 1e-300)
        design = np.stack([weight * rough / size[0], weight * light / size[1]], 1)
        shares = nnls(design, weight * (squares - known))[0] / size
    return float(shares[0]), float(shares[1])


def _alike(nm: Floats, noise: Floats) -> float:
    """Of how many neighbouring wavelengths the noise is alike: one and twice its correlations."""
    farthest = int(FARTHEST_NM / float(np.median(np.diff(nm))))
    power = float(noise @ noise)
    total = 1.0
    for apart in range(1, min(farthest, len(noise) - 1) + 1):
        correlation = float(noise[apart:] @ noise[:-apart]) / max(power, 1e-300)
        if correlation < LEAST_SIGMAS / len(noise) ** 0.5:
            break
        total += 2 * correlation
    return total
