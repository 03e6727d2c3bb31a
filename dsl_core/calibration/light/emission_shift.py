"""What the spectra of the LEDs say of wavelengths: how light in each band changes when the emission moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.spectra import hat_moments

Floats = NDArray[np.float64]

#: Relative step of wavelengths for slopes.
STRETCH = 1e-3


def steepness(rig: Rig, order: int, bands_nm: Floats, step_nm: float) -> Floats:
    """Relative change of white light in each band for a relative shift of the emission, (3, bands).

    Efficiency and response are measured through filters, so that they share the filters' wavelengths; the
    emission has those of the spectroradiometer.
    """
    towards_red, towards_blue = (
        hat_moments(stretched(rig, 1 + sign * STRETCH), order, bands_nm, step_nm)[0].sum(1)
        for sign in (1, -1)
    )
    middle = 0.5 * (towards_red + towards_blue)
    change = (towards_blue - towards_red) / (2 * STRETCH)
    return np.asarray(np.where(middle > 0, change / np.where(middle > 0, middle, 1.0), 0.0))


def stretched(rig: Rig, factor: float) -> Rig:
    """The rig with its emission at wavelengths ``factor`` times as long."""
    red, green, blue = (
        curve.model_copy(update={"wavelengths_nm": tuple(factor * nm for nm in curve.wavelengths_nm)})
        for curve in rig.emission
    )
    return rig.model_copy(update={"emission": (red, green, blue)})
