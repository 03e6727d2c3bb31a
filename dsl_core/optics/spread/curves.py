"""A measured line spread as light: integrals of its Gaussians, tabulated and interpolated."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import ndtr
from torch import Tensor

from dsl_core.model.projector.line_spread import REACH, LineSpread, Spread

Floats = NDArray[np.float64]
#: Samples a column, at least; linear interpolation between them errs by less than 1e-5.
SAMPLES = 256
#: Share of the light beyond the reach of a curve, on either side.
BEYOND = 0.006


def mixed(spread: LineSpread, reach_px: float, of_one: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """Even distances (px) and what a function of the distance from each Gaussian's centre adds up to there.

    ``of_one`` is that of a Gaussian that holds all light, constant beyond ``reach_px`` from its centre.
    """
    stride = math.ceil(spread.step_px * SAMPLES)
    sample_px = spread.step_px / stride
    half = math.ceil(reach_px / sample_px)
    offsets = (len(spread.shares) - 1) * stride
    # From the last Gaussian as seen on the left end to the first one as seen on the right end.
    one = of_one(np.arange(-half - offsets, half + offsets + 1, dtype=np.float64) * sample_px)
    count = 2 * half + 1 + offsets
    total = np.zeros(count)
    for i, share in enumerate(spread.shares):
        start = offsets - i * stride
        total += share * one[start : start + count]
    return spread.first_px + (np.arange(count, dtype=np.float64) - half) * sample_px, total


@lru_cache(maxsize=16)
def _steps(spread: LineSpread) -> tuple[Floats, Floats]:
    return mixed(spread, REACH * spread.core_px, lambda x: ndtr(x / spread.core_px))


@lru_cache(maxsize=16)
def _densities(spread: LineSpread) -> tuple[Floats, Floats]:
    return mixed(spread, REACH * spread.core_px, lambda x: gaussian(x, spread.core_px))


def gaussian(distance_px: Floats, width_px: float) -> Floats:
    """Density of a Gaussian of this rms width, 1/px."""
    return np.asarray(np.exp(-0.5 * (distance_px / width_px) ** 2) / (math.sqrt(2 * math.pi) * width_px))


def step_response(spread: Spread, distance_px: Floats) -> Floats:
    """Light up to a distance (px) from a step, same shape, 0..1."""
    if isinstance(spread, LineSpread):
        return np.interp(distance_px, *_steps(spread))
    return np.asarray(ndtr(distance_px / spread))


def density(spread: Spread, distance_px: Floats) -> Floats:
    """Light of a narrow line at a distance (px), same shape, 1/px: the derivative of the step's."""
    if isinstance(spread, LineSpread):
        return np.interp(distance_px, *_densities(spread))
    return gaussian(distance_px, spread)


class EvenTable:
    """Curves tabulated at even distances, interpolated linearly, and constant beyond the ends."""

    def __init__(self, low: float, step: float, curves: Sequence[Floats], like: Tensor) -> None:
        """Curves (samples,) from ``low`` in steps of ``step``, looked up in the precision of ``like``."""
        self.low, self.step, self.last = low, step, len(curves[0]) - 1.001
        self.curves = [torch.as_tensor(curve).to(like) for curve in curves]

    def at(self, distance: Tensor) -> list[Tensor]:
        """Each curve at distances, same shape."""
        position = torch.nan_to_num_((distance - self.low) * (1 / self.step)).clip_(0, self.last)
        whole = position.int()
        share = position - whole
        flat = whole.reshape(-1)
        above = flat + 1
        return [
            torch.lerp(
                curve.index_select(0, flat).reshape(distance.shape),
                curve.index_select(0, above).reshape(distance.shape),
                share,
            )
            for curve in self.curves
        ]


def step_table(spread: Spread, like: Tensor) -> EvenTable:
    """`step_response` and `density`, looked up in the precision of ``like``."""
    if isinstance(spread, LineSpread):
        distance, light = _steps(spread)
        return EvenTable(
            float(distance[0]), float(distance[1] - distance[0]), [light, _densities(spread)[1]], like
        )
    half = math.ceil(REACH * spread * SAMPLES)
    distance = np.arange(-half, half + 1) / SAMPLES
    curves = [step_response(spread, distance), density(spread, distance)]
    return EvenTable(float(distance[0]), 1 / SAMPLES, curves, like)


def reach_px(spread: LineSpread) -> float:
    """Distance (px) beyond which hardly any light of a curve falls on either side."""
    grid, values = _steps(spread)
    low, high = np.searchsorted(values, [BEYOND, 1 - BEYOND])
    return float(max(-grid[low], grid[high]))
