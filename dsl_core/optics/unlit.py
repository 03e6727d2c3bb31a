"""Where the light of scan lines falls around a pixel's zero order, and where between the orders none does."""

from __future__ import annotations

import numpy as np

from dsl_core.model.rig import Rig

#: Blur widths beyond a line's edge within which its light counts.
BLUR_WIDTHS = 3.0
#: Decays of the halo after which the model of what is left of it is good enough to be subtracted.
HALO_DECAYS = 2.0
#: Nearer than this share of the way to the first orders there is always room for the halo to fall.
NEAREST_SHARE = 0.5


def first_order_reach_px(rig: Rig) -> tuple[float, float]:
    """Distances (px) within which first orders of visible light may fall, whatever the film's density."""
    sine = np.array([390.0, 710.0]) / rig.film.period_nm
    at = rig.projector.fx_px * np.tan(np.arcsin(sine.clip(max=0.9)))
    return float(0.85 * at[0]), float(1.15 * at[1])


def unlit_px(rig: Rig, width_px: int) -> tuple[float, float]:
    """Distances (px) between which the middle of a line is where no order of it reaches a pixel.

    From where the halo of the zero order has fallen to where the shortest visible wavelength of a first order
    may begin, less the line's own width and blur. Coarse films and projectors of few columns leave no such
    place: then the second is not larger than the first.
    """
    response = rig.projector_response
    edge_px = width_px / 2 + BLUR_WIDTHS * response.blur_px
    last = first_order_reach_px(rig)[0] - edge_px
    halo_px = HALO_DECAYS * response.halo_decay_px if response.halo_peak_per_px > 0 else 0.0
    return max(halo_px, edge_px, NEAREST_SHARE * last), last
