"""The wave of columns with the period of the lines that is left when the line spread is not the true one.

Over a run of neighbouring pixels the column changes smoothly, while its place between two lines goes through
whole periods. What goes with that place is an error of the profile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

#: Degree of the polynomial that the columns of a run follow.
DEGREE = 3
#: The shortest wave, px.
SHORTEST_PX = 0.5
#: Runs that scatter so many times as much as others are not smooth.
ROUGH = 4.0
#: A run needs so many pixels.
MIN_RUN = 6
#: Keeps waves at zero that runs do not show, relative to the pixels.
RIDGE = 0.1
#: Places on the projector at which runs count as one, and how many deviations a wave must have.
PLACES, SIGMAS = 24, 3.0
#: No wave is larger, px.
LARGEST_PX = 0.3


@dataclass(frozen=True)
class Wave:
    """The wave at each pixel of runs, ``px`` (runs, pixels), and which runs are ``smooth`` (runs,).

    ``std_px`` is how far a column is from its smooth run without the wave; infinite where no run shows it.
    """

    px: Tensor
    smooth: Tensor
    std_px: float


def column_wave(column_px: Tensor, used: Tensor, period_px: float) -> Wave:
    """The wave in the columns of runs of neighbours (runs, pixels) of which some pixels are ``used``."""
    count = math.floor(period_px / SHORTEST_PX)
    angle = column_px.nan_to_num() * (2 * math.pi / period_px)
    waves = torch.stack([f(k * angle) for k in range(1, count + 1) for f in (torch.sin, torch.cos)], -1)
    weight = used.to(column_px)[..., None]
    smooth = used.sum(1) >= MIN_RUN
    at = torch.linspace(-1, 1, column_px.shape[1]).to(column_px)
    powers = torch.stack([at**k for k in range(DEGREE + 1)], -1)
    both = torch.cat([waves, column_px.nan_to_num()[..., None]], -1) * weight
    # What a polynomial of each run takes is its own.
    normal = torch.einsum("li,lj,rl->rij", powers, powers, weight[..., 0])
    normal = normal + 1e-9 * torch.eye(DEGREE + 1).to(normal)
    taken = torch.linalg.solve(normal, torch.einsum("li,rlk->rik", powers, both))
    both = both - weight * torch.einsum("li,rik->rlk", powers, taken)
    shapes, values = both[..., :-1], both[..., -1]
    found = torch.zeros(shapes.shape[-1]).to(column_px)
    free = (used.sum(1) - DEGREE - 1).clip(min=1)
    std = math.inf
    for _ in range(3):
        if not smooth.any():
            return Wave(torch.zeros_like(column_px), smooth, math.inf)
        found = _significant(shapes[smooth], values[smooth], column_px[smooth].nan_to_num().mean(1))
        scatter = ((values - shapes @ found).square().sum(1) / free).sqrt()
        std = float(scatter[smooth].median())
        smooth = smooth & (scatter < ROUGH * max(std, 1e-6))
    return Wave((waves @ found).clip(-LARGEST_PX, LARGEST_PX), smooth, std)


def _significant(shapes: Tensor, values: Tensor, place_px: Tensor) -> Tensor:
    """Coefficients of shapes (runs, pixels, n) for values (runs, pixels), as far as chance does not explain.

    Where a surface is flat, runs at one place (runs,) of the projector have the same errors, row by row, and
    count as one.
    """
    flat = shapes.flatten(0, 1)
    size = RIDGE * len(flat) * torch.eye(flat.shape[1]).to(flat)
    inverse = torch.linalg.inv(flat.T @ flat + size)
    found = inverse @ (flat.T @ values.flatten())
    pulls = torch.einsum("rlk,rl->rk", shapes, values - shapes @ found)
    place = place_px.argsort().argsort() * min(PLACES, len(place_px)) // len(place_px)
    common = torch.zeros(min(PLACES, len(place_px)), flat.shape[1]).to(flat).index_add_(0, place, pulls)
    variance = torch.diagonal(inverse @ common.T @ common @ inverse)
    return torch.where(found**2 > SIGMAS**2 * variance, found, 0.0)
