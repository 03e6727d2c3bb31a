"""What a film of a shape of its own, such as a twist, does to columns of first orders."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.film.order_samples import OrderSamples
from dsl_core.model.rig import Rig

Floats = NDArray[np.float64]

#: A film of another shape displaces columns by polynomials of this total degree with coefficients of about so
#: many columns (px); they are of place, inverse depth, and wavelength from these limits (nm).
WARP_DEGREE, WARP_STD_PX = 3, 1.0
_MIDDLE_NM, _HALF_NM = 545.0, 115.0


def warp_terms(rig: Rig, samples: OrderSamples) -> Floats:
    """What the shape of a film can do to columns, for each order by itself, (n, terms).

    Products of Chebyshev polynomials in place, inverse depth and wavelength. None of them moves all light of
    a wavelength: that would be another filter.
    """
    rows, columns = np.divmod(samples.pixel, rig.camera.width_px)
    near, far = rig.depth_range_mm
    axes = (
        2 * columns / (rig.camera.width_px - 1) - 1,
        2 * rows / (rig.camera.height_px - 1) - 1,
        2 * (1 / samples.depth_mm - 1 / far) / (1 / near - 1 / far) - 1,
        (samples.wavelength_nm - _MIDDLE_NM) / _HALF_NM,
    )
    powers = [np.polynomial.chebyshev.chebvander(axis, WARP_DEGREE) for axis in axes]
    terms = [
        powers[0][:, i] * powers[1][:, j] * powers[2][:, k] * powers[3][:, n]
        for i, j, k, n in np.ndindex((WARP_DEGREE + 1,) * 3 + (2,))
        if i + j + k + n <= WARP_DEGREE and (i + j or not n)
    ]
    own = [samples.order == order for order in np.unique(samples.order)]
    return np.stack([term * mine for mine in own for term in terms], 1)
