"""Whether the camera's pixels see the colours that its calibration says: which are red, green and blue.

A line lights a point with one wavelength after another, longer ones from farther away, so that pixels under
red filters see their light elsewhere than those under blue ones, whatever the surface. A wrong Bayer pattern,
or colours that a driver has exchanged, are told from that without any spectrum.
"""

from __future__ import annotations

from typing import get_args

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.rig import BayerPattern, Rig, colour_sites
from dsl_core.optics.spectra import chain_response
from dsl_core.reconstruction.spectral.first_order_light import NM, FirstOrderLight

Floats = NDArray[np.float64]
#: Pixels of each site that are needed, and deviations of their light.
FEWEST, SIGMAS = 20, 20.0
#: Mean wavelengths are off by this much, rms, in the pattern that is stated, and by this share of it at most
#: in another one.
WRONG_NM, RIGHT_SHARE = 15.0, 0.5
#: A share of pixels with another colour from which on nothing of a result is right.
LIMIT = 0.01
#: Name of what is found of them.
MOSAIC = "colours of the camera's pixels"


def colour_sites_finding(rig: Rig, seen: FirstOrderLight) -> FitFinding | None:
    """That pixels have other colours than the rig says.

    None where they have not, where nothing can be told, and for cameras without colour.
    """
    stated = rig.sensor.bayer
    light, expected = light_of_sites(rig, seen)
    if light is None or stated == "MONO":
        return None
    seen_nm = (light @ NM) / light.sum(1)
    own_nm = (expected @ NM) / expected.sum(1)

    def off_nm(bayer: BayerPattern) -> float:
        # The surface's own colour moves all of them.
        return float((seen_nm - own_nm[list(colour_sites(bayer))]).std())

    patterns: tuple[BayerPattern, ...] = get_args(BayerPattern)
    best = min((each for each in patterns if each != "MONO"), key=off_nm)
    if off_nm(stated) < WRONG_NM or off_nm(best) > RIGHT_SHARE * off_nm(stated):
        return None
    other = np.mean(np.array(colour_sites(best)) != np.array(colour_sites(stated)))
    return FitFinding.judged(
        "response",
        MOSAIC,
        float(other),
        "1",
        LIMIT,
        f"The camera's pixels see the colours of the lines as those of a mosaic of {best} do, and not of"
        f" {stated}, as calibrated. Spectra are wrong, and depth may be, by far more than their deviations"
        " say.",
        f'Give "bayer": "{best}" in the rig\'s file, or have the driver send mosaics that are not flipped,'
        " with red and blue in their places; then repeat the calibration.",
    )


def light_of_sites(rig: Rig, seen: FirstOrderLight) -> tuple[Floats | None, Floats]:
    """Light of the four sites of a mosaic, (4, n) over `NM`, and that expected of white in colours, (3, n).

    The former is None where too few pixels get all wavelengths through an order, or too little light.
    """
    light, noise, expected = np.zeros((4, NM.size)), np.zeros(4), np.zeros((3, NM.size))
    counts = np.zeros(4, np.intp)
    for order, radiance in seen.radiance.items():
        whole = np.isfinite(radiance).all(0)
        for own in range(4):
            of = whole & (seen.site == own)
            light[own] += radiance[:, of].sum(1)
            noise[own] += seen.variance[order][:, of].sum()
            counts[own] += int(of.sum())
        expected += whole.sum() * chain_response(rig, order, NM).sum(1)
    enough = counts.min() >= FEWEST and (light.sum(1) > SIGMAS * np.sqrt(noise)).all()
    return (light if enough else None), expected
