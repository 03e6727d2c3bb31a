"""A model that takes over what a scan itself says about the film: where the first orders are, how bright.

A film that was touched since the calibration shifts its orders by a fraction of a column and changes their
light. The probe of a scan tells both from the zero order and from orders that disagree. What is too small to
matter, or could be chance, is left as calibrated; so is what does not make the frames fit better: few spectra
on a small piece may look like a shift.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.geometry import Lens
from dsl_core.optics.correspondence import Correspondence, Footprint, like
from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.spectral.causes import Causes, shift_terms
from dsl_core.reconstruction.spectral.probe import Probe

Floats = NDArray[np.float64]

#: How many deviations the chi-square of pixels has to fall by.
SURELY = 3.0


class ShiftedOrders:
    """A correspondence whose first orders are shifted smoothly over the camera's picture."""

    def __init__(self, base: Correspondence, camera: Lens, terms_px: dict[int, Floats]) -> None:
        self.base, self.camera, self.terms_px = base, camera, terms_px

    def trace(
        self, pixels: Tensor, depth_mm: Tensor, order: int, wavelengths_nm: NDArray[np.float64]
    ) -> Footprint:
        """See `Correspondence`."""
        seen = self.base.trace(pixels, depth_mm, order, wavelengths_nm)
        if order not in self.terms_px:
            return seen
        y, x = np.divmod(pixels.cpu().numpy(), self.camera.width_px)
        terms = shift_terms(2 * x / self.camera.width_px - 1, 2 * y / self.camera.height_px - 1)
        return Footprint(seen.columns + like(terms @ self.terms_px[order], seen.columns), seen.rows)


def corrected(model: PixelModel, causes: Causes) -> PixelModel | None:
    """The model with what the causes say of the film that matters; None where nothing does."""
    correspondence, bands = model.correspondence, model.bands
    if causes.moved:
        terms = dict(zip(ORDERS, causes.terms_px, strict=True))
        correspondence = ShiftedOrders(correspondence, model.rig.camera, terms)
    if causes.unequal:
        own = causes.gain - causes.common_gain
        gains = {order: 1 + float(gain) for order, gain in zip(ORDERS, own, strict=True)}
        moments = {order: values * gains.get(order, 1.0) for order, values in bands.moments.items()}
        bands = replace(bands, moments=moments)
    if correspondence is model.correspondence and bands is model.bands:
        return None
    return PixelModel(model.rig, bands, model.profiles, correspondence, model.lines)


def fits_better(before: Probe, after: Probe) -> bool:
    """Whether the frames of the pixels in both probes fit the second model better, not by chance."""
    both = before.sound & after.sound
    fall = (before.chi_square - after.chi_square)[both]
    return bool(both.sum() > 1 and fall.mean() > SURELY * fall.std() / np.sqrt(both.sum()))
