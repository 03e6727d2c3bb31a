"""The light of each line frame, from what probed pixels say of it beside all their other frames.

A frame that had more light than its neighbours is too bright in every pixel that it reaches, whatever band of
the spectrum it lights there. The spectrum of each pixel is eliminated, so that only what no spectrum can take
up counts: both first orders, three colours and a smooth spectrum say what a frame should be. What frames say
of each other without any model (`dsl_core.reconstruction.light.line_levels`) is where it starts from; that
leaves open the frames whose zero order is outside the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.reconstruction.spectral.probing.probe import CHUNK, FEWEST, probe_targets
from dsl_core.reconstruction.spectral.probing.probed_light import ProbedLight, ProbedScan
from dsl_core.reconstruction.spectral.probing.solved_pixels import SolvedPixels, solve_pixels
from dsl_core.solve.threads import one_kernel_thread

Floats = NDArray[np.float64]

#: The least that a level is unsure by before: neighbouring frames share their errors.
LEAST_STD = 0.004
#: Pixels whose equations are in memory at a time.
TOGETHER = 16


@dataclass(frozen=True)
class FrameLevels:
    """Logarithm of the light of each line frame (frames,) over what was taken for it, and its deviation."""

    log: Floats
    std: Floats


def frame_levels(scan: ProbedScan, std: Floats) -> FrameLevels | None:
    """Levels of the frames of a scan of single lines, whose own are unsure by ``std`` (frames,).

    None for other patterns, and where there are too few pixels.
    """
    targets = probe_targets(scan.pixels.valid)
    if not scan.model.single or len(targets) < FEWEST:
        return None
    count = len(scan.radiance)
    normal, score = torch.zeros((count, count)).double(), torch.zeros(count).double()
    with torch.inference_mode(), one_kernel_thread():
        for start in range(0, len(targets), CHUNK):
            solved = solve_pixels(scan, targets[start : start + CHUNK])
            for first in range(0, len(solved.nodes), TOGETHER):
                _add(solved, slice(first, first + TOGETHER), normal, score)
    prior = np.maximum(std, LEAST_STD) ** -2
    covariance = np.linalg.inv(normal.numpy() + np.diag(prior))
    return FrameLevels(covariance @ score.numpy(), np.sqrt(np.diag(covariance)))


def _add(solved: SolvedPixels, part: slice, normal: Tensor, score: Tensor) -> None:
    """Add the equations of some pixels, each with the weight that its frames' fit deserves."""
    pixels, bands = solved.nodes[part].shape
    here = (solved.owner >= part.start) & (solved.owner < part.start + pixels)
    assert isinstance(solved.light, ProbedLight)
    weight, residual = solved.light.weight[here], solved.residual[here]
    # A change of level by one is all of the light of a frame: what the model says of it.
    light = (solved.nodes[solved.owner[here]][:, None] @ solved.rows[here])[:, 0]
    frames = len(score) + 1
    at = ((solved.owner[here] - part.start)[:, None] * frames + solved.light.frame[here]).reshape(-1)

    def by_frame(values: Tensor) -> Tensor:
        """Sums over the samples of pixels and their frames, without the zero order behind the last."""
        into = values.new_zeros((pixels * frames, *values.shape[2:]))
        into.index_add_(0, at, values.flatten(0, 1))
        return into.reshape(pixels, frames, *values.shape[2:])[:, :-1]

    trust = 1 / solved.chi_square[part].clip(min=1)
    cross = by_frame((solved.heavy[here] * light[:, None]).mT)
    own = by_frame(weight * light**2)
    score += (trust[:, None] * by_frame(weight * light * residual)).sum(0)
    normal += torch.diag((trust[:, None] * own).sum(0))
    taken_up = solved.give_way(cross.mT, part).reshape(pixels * bands, -1)
    heavy = (cross * trust[:, None, None]).mT.reshape(pixels * bands, -1)
    normal -= heavy.T @ taken_up
