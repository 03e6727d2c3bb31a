"""Whether the first orders share the light as calibrated, where both reach a pixel: its colour cancels.

Small differences are followed with the spectra. A film that was turned over, or is another one, differs by
more than that can follow.
"""

from __future__ import annotations

import numpy as np

from dsl_core.model.fit import FitFinding
from dsl_core.model.rig import Rig
from dsl_core.reconstruction.spectral.first_order_light import NM, FirstOrderLight

#: Light of both orders is compared at a wavelength where it is so many deviations bright; so many have to be.
SIGMAS, FEWEST = 20.0, 6
#: By how much the ratio of the orders may be off for spectra to be right, and what is followed with them.
LIMIT, FOLLOWED = 0.05, 0.25
#: What their ratio is called.
BALANCE = "ratio of the orders"


def order_balance_finding(rig: Rig, light: FirstOrderLight) -> FitFinding | None:
    """That the orders share the light otherwise than spectra can follow; None where pixels do not say so."""
    if not {1, -1} <= set(rig.efficiency):
        return None
    both = np.isfinite(light.radiance[1]) & np.isfinite(light.radiance[-1])
    seen = {order: np.where(both, light.radiance[order], 0).sum(1) for order in (1, -1)}
    std = {order: np.sqrt(np.where(both, light.variance[order], 0).sum(1)) for order in (1, -1)}
    bright = (seen[1] > SIGMAS * std[1]) & (seen[-1] > SIGMAS * std[-1])
    if bright.sum() < FEWEST:
        return None
    usual = rig.efficiency[1].at(NM[bright]) / rig.efficiency[-1].at(NM[bright])
    ratios = seen[1][bright] / seen[-1][bright] / usual
    ratio = float(np.median(ratios))
    if abs(ratio - 1) < FOLLOWED:
        return None
    return FitFinding.judged(
        "orders",
        BALANCE,
        ratio - 1,
        "1",
        LIMIT,
        f"Order +1 is {ratio:.2f} times as bright against order -1 as calibrated: the film has been turned"
        " over, or is another one.",
        "Mount the film as it was at the calibration, or calibrate with the bandpass filters again.",
    )
