"""Columns that lines leave loose: the mean of all places that explain the frames and the code.

Where lines are no narrower than their step, none shows a slope in the middle of one: a fit stops where one
begins, and its curvature there knows nothing of the places in between.
"""

from __future__ import annotations

import torch
from torch import Tensor

from dsl_core.reconstruction.columns.line_peaks import LinePeaks

#: Columns less sure than this are weighed over all places as far from the decoded one as that, and so many.
LOOSE_PX, FARTHEST_PX, PLACES = 0.08, 1.2, 49
#: How sure the ends of a decoded column are.
CODE_STD_PX = 0.15


def loose_columns(peaks: LinePeaks, model_error: Tensor, scale: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and deviation (px) of columns (pixels,) over all places that explain the lines and the code.

    ``model_error`` (pixels,) is that of the modelled peak, in its units; ``scale`` is how many times too
    large chi-squares are.
    """
    coarse_px = peaks.coarse_px
    places = torch.linspace(-FARTHEST_PX, FARTHEST_PX, PLACES).to(coarse_px)
    y, variance, centres = peaks.window()
    weight = 1 / (variance + model_error**2)
    reach_px = float((coarse_px - centres).abs().max()) + FARTHEST_PX
    table = peaks.table(coarse_px, reach_px)
    likely = torch.empty((PLACES, len(coarse_px))).to(coarse_px)
    for row, place in zip(likely, places, strict=True):
        g, _ = table.at(coarse_px + place - centres)
        wg = weight * g
        row[:] = -in_order(weight * y * y) + in_order(wg * y) ** 2 / in_order(wg * g).clip(min=1e-30)
    # The code names a column, and is not sure at its ends.
    named = torch.special.log_ndtr((0.5 - places.abs()) / CODE_STD_PX)
    chance = likely / (2 * scale) + named[:, None]
    share = torch.exp(chance - chance.amax(0))
    share /= in_order(share)
    away = places[:, None]
    mean = in_order(share * away)
    spread = in_order(share * (away - mean) ** 2)
    return coarse_px + mean, torch.sqrt(spread + (places[1] - places[0]) ** 2 / 12)


def in_order(values: Tensor) -> Tensor:
    """Sum of rows, one after the other: that of a pixel does not depend on the others with it."""
    total = values[0].clone()
    for row in values[1:]:
        total += row
    return total
