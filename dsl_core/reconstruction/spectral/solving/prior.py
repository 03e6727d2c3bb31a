"""What is believed of spectra before they are measured: that they are smooth, how much so, and bounded."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

#: Band step that the candidates of the prior are for, nm.
STEP_NM = 5.0
#: Data with less than this share of the tightest prior's information are too faint for single precision: the
#: rounding of that prior would choose the smoothness.
FAINT = 0.01


@dataclass(frozen=True)
class Prior:
    """Candidates of the second-difference deviation, the level's mean and deviation, and the bounds.

    The candidates are for bands of `STEP_NM`.
    """

    taus: tuple[float, ...] = (0.002, 0.0085, 0.036, 0.15, 0.6)
    level: float = 0.4
    level_std: float = 0.6
    bounds: tuple[float, float] = (0.0, 1.5)

    def at_step(self, step_nm: float) -> Prior:
        """The same belief in spectra for other bands.

        Were slopes a random walk over wavelength, second differences would vary as the cube of the step.
        """
        scale = (step_nm / STEP_NM) ** 1.5
        return replace(self, taus=tuple(tau * scale for tau in self.taus))


def roughness(bands: int, like: Tensor) -> Tensor:
    """``D'D`` of second differences, banded storage (3, bands)."""
    d = torch.zeros((bands - 2, bands), dtype=torch.float64)
    for i in range(bands - 2):
        d[i, i : i + 3] = torch.tensor([1.0, -2.0, 1.0], dtype=torch.float64)
    full = d.T @ d
    rows = [torch.nn.functional.pad(torch.diagonal(full, o), (0, o)) for o in range(3)]
    return torch.stack(rows).to(like)


def too_faint(information: Tensor, prior: Prior) -> Tensor:
    """Mask (pixels,) of those that single precision cannot solve; none in double.

    ``information`` (bands, pixels) is the diagonal of the data's normal equations.
    """
    if information.dtype == torch.float64:
        return torch.zeros_like(information[0], dtype=torch.bool)
    return information.amax(0) * min(prior.taus) ** 2 < FAINT


def parabola_peak(values: Tensor, positions: Tensor) -> Tensor:
    """Position of the maximum of samples (candidates, pixels) at evenly spaced positions (candidates,)."""
    best = values.argmax(0).clip(1, len(values) - 2)
    left, middle, right = (values.gather(0, (best + i)[None])[0] for i in (-1, 0, 1))
    curvature = (2 * middle - left - right).clip(min=1e-6)
    shift = (0.5 * (right - left) / curvature).clip(-1, 1)
    # Where the middle is a minimum of the three, the better end is taken.
    shift = torch.where(2 * middle - left - right > 0, shift, torch.sign(right - left))
    return positions[best] + shift * (positions[1] - positions[0])
