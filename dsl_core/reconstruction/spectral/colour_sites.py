"""Whether the camera's pixels see the colours that its calibration says: which are red, green and blue.

A line lights a point with one wavelength after another, longer ones from farther away, so that pixels under
red filters see their light elsewhere than those under blue ones, whatever the surface. A wrong Bayer pattern,
or colours that a driver has exchanged, are told from that without any spectrum.
"""

from __future__ import annotations

from typing import get_args

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.rig import BayerPattern, Rig, colour_sites
from dsl_core.optics.correspondence import Correspondence
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spectra import ORDERS, chain_response
from dsl_core.reconstruction.merge import PickedLines
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels

Floats = NDArray[np.float64]
#: Wavelengths at which light is looked for.
NM = np.linspace(430.0, 660.0, 24)
#: Pixels of each site that are needed, and deviations of their light.
FEWEST, SIGMAS = 20, 20.0
#: Mean wavelengths are off by this much, rms, in the pattern that is stated, and by this share of it at most
#: in another one.
WRONG_NM, RIGHT_SHARE = 15.0, 0.5
#: A share of pixels with another colour from which on nothing of a result is right.
LIMIT = 0.01


def colour_sites_finding(
    rig: Rig, lines: LineSet, model: Correspondence, picked: PickedLines, pixels: Pixels
) -> FitFinding | None:
    """That pixels have other colours than the rig says, by the line frames of ``picked`` ones.

    None where they have not, where nothing can be told, and for cameras without colour.
    """
    stated = rig.sensor.bayer
    light, expected = light_of_sites(rig, lines, model, picked, pixels)
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
        "colours of the camera's pixels",
        float(other),
        "1",
        LIMIT,
        f"The camera's pixels see the colours of the lines as those of a mosaic of {best} do, and not of"
        f" {stated}, as calibrated: spectra are wrong.",
        f'Give "bayer": "{best}" in the rig\'s file, or have the driver send mosaics that are not flipped,'
        " with red and blue in their places; then repeat the calibration.",
    )


def light_of_sites(
    rig: Rig, lines: LineSet, model: Correspondence, picked: PickedLines, pixels: Pixels
) -> tuple[Floats | None, Floats]:
    """Light of the four sites of a mosaic, (4, n) over `NM`, and that expected of white in colours, (3, n).

    The former is None where too few pixels get all wavelengths through an order, or too little light.
    """
    width = pixels.valid.shape[1]
    known = pixels.valid.ravel()[picked.pixels]
    index = picked.pixels[known]
    radiance = picked.radiance[:, known] - pixels.offset.ravel()[index]
    variance = np.square(picked.std[:, known], dtype=np.float32)
    site = index // width % 2 * 2 + index % width % 2
    depth_mm = torch.as_tensor(pixels.depth_mm.ravel()[index], dtype=torch.float64)
    light, noise, expected = np.zeros((4, NM.size)), np.zeros(4), np.zeros((3, NM.size))
    counts = np.zeros(4, np.intp)
    for order in ORDERS:
        traced = model.trace(torch.as_tensor(index), depth_mm, order, NM)
        line = lines.nearest(traced.columns)
        whole = lines.exists(line).all(0).numpy()
        if not whole.any():
            continue
        frames, places = lines.frame(line).numpy()[:, whole], np.flatnonzero(whole)
        for own in range(4):
            of = site[places] == own
            light[own] += radiance[frames[:, of], places[of]].sum(1)
            noise[own] += variance[frames[:, of], places[of]].sum()
            counts[own] += int(of.sum())
        expected += whole.sum() * chain_response(rig, order, NM).sum(1)
    enough = counts.min() >= FEWEST and (light.sum(1) > SIGMAS * np.sqrt(noise)).all()
    return (light if enough else None), expected
