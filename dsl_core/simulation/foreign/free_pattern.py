"""Light of patterns that vary along columns and rows both: looked up in a spread picture of the pattern."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.simulation.foreign.light_sources import Sources
from dsl_core.simulation.foreign.spread import FINE
from dsl_core.simulation.foreign.transport import Brought, Frame

Floats = NDArray[np.float64]
#: Samples a pixel of the spread picture, and of the sampled wavelengths one in so many is looked up.
COARSE, EVERY = 4, 4


def free_pattern_light(
    frame: Frame, radiance: Floats, sources: Sources, brought: Brought, wavelengths_nm: Floats
) -> Tensor:
    """Light on an order's active parts, (active,), of a radiance image (height, width).

    The spread is the usual one all over the frame, whatever it is in the corners.
    """
    picture = _spread_picture(frame, radiance, halo=sources.order == 0)
    height, width = picture.shape
    source = torch.as_tensor(picture, dtype=torch.float32)[None, None]
    light = brought.of(sources.active, wavelengths_nm)
    every = EVERY if len(wavelengths_nm) > 100 else 1
    total = torch.zeros(len(sources.active))
    for i in range(0, len(wavelengths_nm), every):
        some = slice(i, i + every)
        columns, rows = (q.float() for q in sources.at(wavelengths_nm[some].mean(keepdims=True)))
        x = (columns[0] + 0.5) * COARSE - 0.5
        y = (rows[0] + 0.5) * COARSE - 0.5
        grid = torch.stack([2 * x / (width - 1) - 1, 2 * y / (height - 1) - 1], -1)[None, None]
        seen = torch.nn.functional.grid_sample(source, grid, align_corners=True)[0, 0, 0]
        total += seen * light[:, some].sum(1)
    return total


def _spread_picture(frame: Frame, radiance: Floats, halo: bool) -> Floats:
    """The image with `COARSE` samples a pixel, spread, (height * COARSE, width * COARSE)."""
    height, width = radiance.shape
    across = _samples(frame, width)
    if halo:
        at = (np.arange(width * COARSE) + 0.5) / COARSE - 0.5
        across = across + frame.halo(torch.as_tensor(at[:, None] - np.arange(width))).numpy()
    return np.asarray(_samples(frame, height) @ radiance @ across.T)


def _samples(frame: Frame, pixels: int) -> Floats:
    """Matrix from pixels to samples of the spread light, (pixels * COARSE, pixels)."""
    at = (np.arange(pixels * COARSE) + 0.5) / COARSE - 0.5
    weights, reach = frame.spread.pixel(), frame.spread.reach
    index = np.rint((at[:, None] - np.arange(pixels)) * FINE).astype(int) + reach
    inside = (index >= 0) & (index < len(weights))
    return np.asarray(np.where(inside, weights[index.clip(0, len(weights) - 1)], 0.0))
