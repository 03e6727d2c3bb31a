"""Lines that pixels on smooth surfaces see, by the projector's response alone."""

from __future__ import annotations

import numpy as np
import torch

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.optics.spread.equations import Peaks

WIDTH_PX, STEP_PX, RUN = 5, 2, 8


def seen(response: ProjectorResponse, runs: int = 250, noise: float = 2e-3) -> tuple[Peaks, torch.Tensor]:
    """Lines that pixels see whose projector has this response, and the columns of the pixels."""
    random = np.random.default_rng(3)
    start, pitch = random.uniform(20, 600, (runs, 1)), random.uniform(0.6, 0.9, (runs, 1))
    column = torch.as_tensor((start + pitch * np.arange(RUN)).ravel())
    centres = (column / STEP_PX).round() * STEP_PX + STEP_PX * torch.arange(-4, 5)[:, None]
    light = zero_order_profile(column - centres, -WIDTH_PX / 2, WIDTH_PX / 2, response)
    amplitude = torch.as_tensor(random.uniform(0.3, 1.0, len(column)))
    y = amplitude * light + noise * torch.as_tensor(random.standard_normal(light.shape))
    return Peaks(y, torch.full_like(y, noise**2), centres, WIDTH_PX, STEP_PX, RUN), column
