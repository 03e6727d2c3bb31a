"""Lines that pixels on smooth surfaces see, by the projector's response alone."""

from __future__ import annotations

import numpy as np
import torch

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.optics.spread.equations import Peaks

WIDTH_PX, STEP_PX, RUN = 5, 2, 8


def seen(
    response: ProjectorResponse,
    runs: int = 250,
    noise: float = 2e-3,
    step_px: int = STEP_PX,
    beside: int = 4,
    pitch_px: tuple[float, float] = (0.6, 0.9),
) -> tuple[Peaks, torch.Tensor]:
    """Lines that pixels see whose projector has this response, and the columns of the pixels.

    Lines are ``step_px`` apart, so many ``beside`` the nearest are seen, and pixels ``pitch_px`` apart.
    """
    random = np.random.default_rng(3)
    start, pitch = random.uniform(20, 600, (runs, 1)), random.uniform(*pitch_px, (runs, 1))
    column = torch.as_tensor((start + pitch * np.arange(RUN)).ravel())
    centres = (column / step_px).round() * step_px + step_px * torch.arange(-beside, beside + 1)[:, None]
    light = zero_order_profile(column - centres, -WIDTH_PX / 2, WIDTH_PX / 2, response)
    amplitude = torch.as_tensor(random.uniform(0.3, 1.0, len(column)))
    y = amplitude * light + noise * torch.as_tensor(random.standard_normal(light.shape))
    return Peaks(y, torch.full_like(y, noise**2), centres, WIDTH_PX, step_px, RUN), column
