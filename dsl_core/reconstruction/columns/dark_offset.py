"""Signal that all line frames of a pixel have alike, from those in which no order lights it."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import halo_of_line


def dark_offset(
    column_px: Tensor,
    amplitude: Tensor,
    radiance: Tensor,
    std: Tensor,
    lines: LineSet,
    response: ProjectorResponse,
    unlit_px: tuple[float, float],
) -> tuple[Tensor, Tensor]:
    """Mean signal (DN per ms) where no order lights a pixel: what its single black frame got wrong.

    Between the zero order and the first orders, at distances ``unlit_px``, are columns that reach a pixel
    only through the halo, which is subtracted. A black frame's noise would be common to all lines of a
    pixel; the mean of dozens of unlit frames takes it out. With its deviation: zero and infinite where a
    pattern set or the film leaves no frame unlit.
    """
    first, last = math.floor(unlit_px[0] / lines.step_px), math.ceil(unlit_px[1] / lines.step_px)
    if not lines.single or unlit_px[1] <= unlit_px[0]:
        return torch.zeros_like(column_px), torch.full_like(column_px, torch.inf)
    total = torch.zeros_like(column_px)
    weight = torch.zeros_like(column_px)
    for side in (-1, 1):
        away = torch.arange(first, last + 1, device=column_px.device)[:, None]
        line = lines.nearest(column_px) + side * away
        frame = lines.frame(line)
        distance = column_px - lines.centre_px(line).to(column_px.dtype)
        dark = torch.gather(radiance, 0, frame) - amplitude * halo_of_line(distance, lines.width_px, response)
        unlit = (distance.abs() >= unlit_px[0]) & (distance.abs() <= unlit_px[1])
        w = (lines.exists(line) & unlit) / torch.gather(std, 0, frame).to(dark.dtype).clip(min=1e-9) ** 2
        total += torch.where(w > 0, dark * w, 0.0).sum(0)
        weight += w.sum(0)
    return total / weight.clip(min=1e-30), 1 / weight.sqrt()
