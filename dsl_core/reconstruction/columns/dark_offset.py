"""Signal that all line frames of a pixel have alike, from those in which no order lights it."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import halo_of_line
from dsl_core.solve.halves import squares_of_halves


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
    if not lines.single or unlit_px[1] <= unlit_px[0]:
        return torch.zeros_like(column_px), torch.full_like(column_px, torch.inf)
    kinds = radiance.device.type, column_px.dtype, amplitude.dtype, radiance.dtype, std.dtype
    # What pictures are made of on a processor; few pixels come in other precisions, and others are for a GPU.
    if (
        kinds == ("cpu", torch.float32, torch.float32, torch.float32, torch.float16)
        and unlit_px[0] >= lines.step_px
    ):
        return _by_pixels(column_px, amplitude, radiance, std, lines, response, unlit_px)
    return by_tensors(column_px, amplitude, radiance, std, lines, response, unlit_px)


def by_tensors(
    column_px: Tensor,
    amplitude: Tensor,
    radiance: Tensor,
    std: Tensor,
    lines: LineSet,
    response: ProjectorResponse,
    unlit_px: tuple[float, float],
) -> tuple[Tensor, Tensor]:
    """As `dark_offset`, where there are unlit frames; in any precision and on any device."""
    first, last = _nearest_and_farthest(lines, unlit_px)
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


def _by_pixels(
    column_px: Tensor,
    amplitude: Tensor,
    radiance: Tensor,
    std: Tensor,
    lines: LineSet,
    response: ProjectorResponse,
    unlit_px: tuple[float, float],
) -> tuple[Tensor, Tensor]:
    """As `by_tensors`, compiled; a test holds both together."""
    # Only who looks for columns needs compiled code.
    from dsl_core.reconstruction.columns.dark_kernels import unlit_means

    first, last = _nearest_and_farthest(lines, unlit_px)
    nearest = lines.nearest(column_px)
    beside = column_px - lines.centre_px(nearest).to(column_px.dtype)
    halos = halo_of_line(
        torch.stack([first * lines.step_px + beside, first * lines.step_px - beside]),
        lines.width_px,
        response,
    )
    away = torch.arange(last + 1 - first, dtype=torch.float64) * lines.step_px
    falls = halo_of_line(away, lines.width_px, response)
    offset, spread = torch.empty_like(column_px), torch.empty_like(column_px)
    unlit_means(
        beside.numpy(), amplitude.numpy(), radiance.numpy(), std.numpy().view(np.uint16),
        squares_of_halves(), nearest.numpy(), halos.numpy(), (falls / falls[0]).nan_to_num(0.0).numpy(),
        first, lines.lines, lines.step_px, *unlit_px, offset.numpy(), spread.numpy(),
    )  # fmt: skip
    return offset, spread


def _nearest_and_farthest(lines: LineSet, unlit_px: tuple[float, float]) -> tuple[int, int]:
    """How many lines away those are that may leave a pixel unlit, on either side."""
    return math.floor(unlit_px[0] / lines.step_px), math.ceil(unlit_px[1] / lines.step_px)
