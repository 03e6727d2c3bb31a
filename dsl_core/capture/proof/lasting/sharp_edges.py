"""Whether camera or projector sharpens its picture: edges of a code are then brighter than white.

Light adds up: what a part of the projector's picture lights is no brighter than what all of it does.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import LIT_SIGMAS, Pair
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster

#: A pixel is brighter than white by this share of its light, and by so many deviations.
OVER, SIGMAS = 0.03, 5.0
#: Of those on bright sides of edges, such a share is, so many, and so many times the share elsewhere; in so
#: many pairs. Clean scans have one in ten thousand.
SHARE, FEWEST, TIMES, FEWEST_PAIRS = 0.005, 8, 4.0, 3
#: A pixel is on the bright side of an edge if the other picture of its pair gives it less than the first
#: share of white, and more than the second to one so near in its row or column, px of the raster's rows.
DARK, BRIGHT, NEAR_PX = 0.1, 0.5, 3
SENTENCE = (
    "Edges of the code's stripes are brighter than white: camera or projector sharpens its picture. Switch"
    " sharpening and edge enhancement of both off, store raw values, and scan again."
)


def sharp_edges(pairs: Mapping[int, Pair], ends: tuple[Counts, Counts], noise: Noise, raster: Raster) -> str:
    """What is wrong with edges of the ``pairs``, and what to do; empty if nothing is.

    ``pairs`` are rasters of a pattern and its inverse by their number, ``ends`` those of white and black.
    """
    white, black = ends
    light = np.maximum(white.astype(np.float32) - black, 1)
    variance = noise.variance(white) + noise.variance(black)
    lit = (light > LIT_SIGMAS * np.sqrt(variance)) & (white < noise.sensor.full_scale_dn)
    if not lit.any():
        return ""
    limit = np.maximum(SIGMAS * np.sqrt(2 * variance), OVER * light)
    found = 0
    for pair in pairs.values():
        one, other = (each.astype(np.float32) - black for each in pair)
        # Of light that has changed since, sums say by how much.
        usual = light * np.median((one + other)[lit] / light[lit])
        beside, elsewhere = np.zeros(2), np.zeros(2)
        for seen, inverse in ((one, other), (other, one)):
            dark = lit & (inverse < DARK * light)
            near = _near((inverse > BRIGHT * light).reshape(raster.shape), raster.rows_px).ravel()
            is_over = seen > usual + limit
            for counts, at in ((beside, dark & near), (elsewhere, dark & ~near)):
                counts += (at & is_over).sum(), at.sum()
        least = max(SHARE, TIMES * elsewhere[0] / max(elsewhere[1], 1)) * beside[1]
        found += beside[0] >= max(FEWEST, least)
    return SENTENCE if found >= FEWEST_PAIRS else ""


def _near(bright: NDArray[np.bool_], rows_px: float) -> NDArray[np.bool_]:
    """Pixels (rows, columns) within `NEAR_PX` of bright ones in their row, or column of rows so far apart."""
    near = bright.copy()
    for each, seen, step_px in ((near, bright, 1.0), (near.T, bright.T, rows_px)):
        for step in range(1, int(NEAR_PX / step_px) + 1):
            each[:, step:] |= seen[:, :-step]
            each[:, :-step] |= seen[:, step:]
    return near
