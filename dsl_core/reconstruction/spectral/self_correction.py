"""A model that takes over what a scan itself says about the light of the film's orders.

A film that has aged or become dirty since the calibration sends less light into one order than into the
other. Pixels that both orders reach, and the zero order, tell by how much. What is too small to matter, or
could be chance, is left as calibrated; so is what does not make the frames fit better. The place of the
orders is not corrected: a scan cannot tell a film that has moved from one that is bent otherwise, or from a
line spread that is not symmetric, and the wrong correction makes spectra worse. Deviations hold it instead.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.spectral.causes import Causes
from dsl_core.reconstruction.spectral.probe import Probe

#: How many deviations the chi-square of pixels has to fall by.
SURELY = 3.0


def corrected(model: PixelModel, causes: Causes) -> PixelModel | None:
    """The model with orders as bright as the scan says, where that matters; None where it does not."""
    if not causes.unequal:
        return None
    own = causes.gain - causes.common_gain
    gains = {order: 1 + float(gain) for order, gain in zip(ORDERS, own, strict=True)}
    moments = {order: values * gains.get(order, 1.0) for order, values in model.bands.moments.items()}
    bands = replace(model.bands, moments=moments)
    return PixelModel(model.rig, bands, model.profiles, model.correspondence, model.lines)


def fits_better(before: Probe, after: Probe) -> bool:
    """Whether the frames of the pixels in both probes fit the second model better, not by chance."""
    both = before.sound & after.sound
    fall = (before.chi_square - after.chi_square)[both]
    return bool(both.sum() > 1 and fall.mean() > SURELY * fall.std() / np.sqrt(both.sum()))
