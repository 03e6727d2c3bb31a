"""Noise taken out of a measured spectrum as far as the noise itself allows.

The spectrum is a Gaussian process whose amplitude follows the spectrum: ``e = a g``, with ``a`` a coarse
envelope and ``g`` of Matern covariance (once differentiable, so that peaks may be sharp). Length and scale
of ``g`` maximise the evidence of the readings (Rasmussen and Williams, *Gaussian Processes for Machine
Learning*, Eq. 5.8): a narrow peak makes the length short, and little is smoothed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Correlation lengths (nm) and scales that are tried.
LENGTHS_NM = np.geomspace(5.0, 160.0, 14)
SCALES = (0.5, 1.0, 2.0, 4.0)
#: Half width (nm) of the envelope's maximum and blur, and its least value as a share of the peak.
ENVELOPE_NM, ENVELOPE_FLOOR = 6.0, 1e-3


@dataclass(frozen=True)
class SmoothCurve:
    """A smoothed curve with its deviation, both of shape (wavelengths,), and the length chosen (nm)."""

    values: Floats
    std: Floats
    length_nm: float


def smooth_curve(wavelengths_nm: Floats, values: Floats, std: Floats) -> SmoothCurve:
    """The most likely smooth curve behind values with independent noise of known deviation.

    All of shape (wavelengths,); values in any unit. Not clipped at zero: that would bias dark wings.
    """
    from scipy.linalg import cho_solve

    peak = float(np.abs(values).max()) or 1.0
    y, noise = values / peak, np.maximum(std / peak, 1e-9)
    envelope = _envelope(wavelengths_nm, y, noise)
    distance = np.abs(wavelengths_nm[:, None] - wavelengths_nm)
    best = (-np.inf, 0.0, np.empty(0))
    for length in LENGTHS_NM:
        shape = _matern(distance / length) * np.outer(envelope, envelope)
        for scale in SCALES:
            # numpy's lets other threads run meanwhile, scipy's does not; with one right side that is brief.
            factor = np.linalg.cholesky(scale**2 * shape + np.diag(noise**2)), True
            evidence = -0.5 * y @ cho_solve(factor, y) - np.log(np.diag(factor[0])).sum()
            if evidence > best[0]:
                best = (float(evidence), float(length), scale**2 * shape)
    _, length_nm, prior = best
    solved = np.linalg.solve(prior + np.diag(noise**2), np.column_stack([y, prior]))
    mean = prior @ solved[:, 0]
    spread = np.diag(prior) - np.einsum("ij,ij->j", prior, solved[:, 1:])
    return SmoothCurve(mean * peak, np.sqrt(np.maximum(spread, 0)) * peak, length_nm)


def _matern(distance: Floats) -> Floats:
    """Matern correlation of smoothness 3/2 at a distance in units of its length."""
    d = np.sqrt(3.0) * distance
    return np.asarray((1 + d) * np.exp(-d))


def _envelope(wavelengths_nm: Floats, values: Floats, noise: Floats) -> Floats:
    """How large the curve is around each wavelength, never below the noise or a share of its peak."""
    from scipy.ndimage import gaussian_filter1d, maximum_filter1d

    width = max(ENVELOPE_NM / float(np.median(np.diff(wavelengths_nm))), 1.0)
    blurred = gaussian_filter1d(values, width / 2, mode="nearest")
    largest = maximum_filter1d(np.abs(blurred), 2 * round(width) + 1, mode="nearest")
    least = np.maximum(ENVELOPE_FLOOR, noise / np.sqrt(width))
    return np.asarray(np.maximum(gaussian_filter1d(largest, width, mode="nearest"), least))
