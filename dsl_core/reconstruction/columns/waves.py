"""What the line profile leaves in the columns: waves with the period of the lines, region by region.

A spread that varies over the field is not the one curve that all pixels share. Where it differs, columns over
smooth surfaces have waves; how large these are is an error that no pixel's own fit can know of.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.optics.line_set import LineSet
from dsl_core.optics.spread.wave import column_wave

#: Regions of the picture, down and across; neighbours of a row in a run.
REGIONS, RUN = (4, 6), 10
#: Runs of a region, at least and at most, and how often they are asked: each time most of a wave is found.
FEWEST, MOST, ASKED = 30, 400, 3


def wave_std_px(
    column_px: NDArray[np.floating], refined: NDArray[np.bool_], lines: LineSet | None
) -> NDArray[np.float32]:
    """Rms of the waves around each pixel (rows, columns), px; 0 where there are none or nobody can tell.

    ``column_px`` and ``refined`` (rows, columns) are the columns of all pixels and where lines refined them.
    """
    std = np.zeros(column_px.shape, np.float32)
    if lines is None or not lines.single:
        return std
    rows, columns = (
        np.linspace(0, size, parts + 1).astype(int)
        for size, parts in zip(column_px.shape, REGIONS, strict=True)
    )
    for top, bottom in pairwise(rows):
        for left, right in pairwise(columns):
            where = np.s_[top:bottom, left:right]
            std[where] = _rms(column_px[where], refined[where], lines.step_px)
    return std


def _rms(column_px: NDArray[np.floating], refined: NDArray[np.bool_], period_px: float) -> float:
    """Rms of the wave of a region, px."""
    width = column_px.shape[1] // RUN * RUN
    used = refined[:, :width].reshape(-1, RUN)
    whole = np.flatnonzero(used.all(1))
    whole = whole[:: max(len(whole) // MOST, 1)]
    if len(whole) < FEWEST:
        return 0.0
    runs = torch.as_tensor(column_px[:, :width].reshape(-1, RUN)[whole].astype(np.float64))
    straight = runs
    for _ in range(ASKED):
        wave = column_wave(straight, torch.ones_like(runs, dtype=torch.bool), period_px)
        if int(wave.smooth.sum()) < FEWEST:
            return 0.0
        straight = straight - wave.px
    return float((runs - straight)[wave.smooth].square().mean().sqrt())
