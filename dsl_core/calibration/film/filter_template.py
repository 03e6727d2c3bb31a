"""What a projected line looks like through a bandpass filter: its profile over projector columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.spectra import chain_response

Floats = NDArray[np.float64]

#: Fine grid for integrals over a filter, nm.
STEP_NM = 0.5
#: Light below this share of the brightest wavelength is left out of a filter's extent.
EXTENT_SHARE = 0.01


@dataclass(frozen=True)
class FilterTemplate:
    """Light of one order through one filter, for each colour of the camera.

    ``density`` (3, wavelengths) integrates to one for each colour, ``cumulative`` is its running integral and
    ``signal`` (3,) what was divided out, DN per ms. ``centroid_nm`` is that of all colours together.
    """

    order: int
    centroid_nm: float
    extent_nm: tuple[float, float]
    wavelengths_nm: Floats
    density: Floats
    cumulative: Floats
    signal: Floats

    def between(self, start_nm: Floats, stop_nm: Floats, colour: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Light between two wavelengths, and the density at the second less that at the first."""
        light, slope = np.zeros(start_nm.shape), np.zeros(start_nm.shape)
        nm = self.wavelengths_nm
        for c in range(3):
            mine = colour == c
            a, b = start_nm[mine], stop_nm[mine]
            light[mine] = np.interp(b, nm, self.cumulative[c]) - np.interp(a, nm, self.cumulative[c])
            slope[mine] = np.interp(b, nm, self.density[c], 0, 0) - np.interp(a, nm, self.density[c], 0, 0)
        return light, slope


def filter_template(
    rig: Rig, transmission: SpectralCurve, order: int, dispersion_px_per_nm: float
) -> FilterTemplate:
    """The light of a line through a filter: transmission x response x emission x efficiency, blurred.

    The centroid of that product is the effective wavelength, not the filter's nominal centre. The
    projector's blur is put into the spectrum, by the dispersion. Raises `CalibrationError` when the chain has
    no light at all there.
    """
    from scipy.ndimage import gaussian_filter1d

    nm = np.arange(transmission.wavelengths_nm[0] - 20, transmission.wavelengths_nm[-1] + 20, STEP_NM)
    passed = np.interp(nm, transmission.wavelengths_nm, transmission.values, 0, 0)
    spectrum = chain_response(rig, order, nm).sum(1) * passed
    total = spectrum.sum()
    if not total > 0:
        raise CalibrationError(
            f"No light of order {order:+d} passes the filter from {transmission.wavelengths_nm[0]:g} to"
            f" {transmission.wavelengths_nm[-1]:g} nm by the calibration so far. Check the filter's curve."
        )
    centroid = float((spectrum.sum(0) * nm).sum() / total)
    lit = nm[spectrum.sum(0) > EXTENT_SHARE * spectrum.sum(0).max()]
    sigma = rig.projector_response.blur_px / dispersion_px_per_nm / STEP_NM
    signal = spectrum.sum(1) * STEP_NM
    # A colour that is blind to this filter has the profile of all of them, with no light.
    shape = np.where((signal > 1e-6 * signal.max())[:, None], spectrum, spectrum.sum(0))
    density = gaussian_filter1d(
        shape / (shape.sum(1, keepdims=True) * STEP_NM), sigma, axis=1, mode="constant"
    )
    middle = 0.5 * (density[:, 1:] + density[:, :-1]) * STEP_NM
    cumulative = np.concatenate([np.zeros((3, 1)), np.cumsum(middle, 1)], 1)
    return FilterTemplate(order, centroid, (float(lit[0]), float(lit[-1])), nm, density, cumulative, signal)
