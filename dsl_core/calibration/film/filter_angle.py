"""Columns of filters' first orders as they would be if filters did not shift with the angle of view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.film.order_samples import OrderSamples, grating_columns
from dsl_core.model.rig import Rig
from dsl_core.optics.filters import FilterAngle, relative_shift, shift_terms

Floats = NDArray[np.float64]

#: Step of differences over the share of a wavelength.
SHARE_STEP = 1e-3


def columns_per_share(rig: Rig, samples: OrderSamples) -> Floats:
    """By how many columns samples move when their wavelengths are all longer by a share, divided by it."""
    longer = replace(samples, wavelength_nm=samples.wavelength_nm * (1 + SHARE_STEP))
    return (grating_columns(rig, longer) - grating_columns(rig, samples)) / SHARE_STEP


def seen_straight(rig: Rig, samples: OrderSamples, angle: FilterAngle) -> OrderSamples:
    """The samples as they would be through filters that shift nothing."""
    shift = relative_shift(shift_terms(rig, samples.pixel), np.array(angle.values))
    return replace(samples, column_px=samples.column_px - columns_per_share(rig, samples) * shift)
