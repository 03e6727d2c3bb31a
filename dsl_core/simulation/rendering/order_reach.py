"""Which pixels an order of the film may light at all: much of a picture is out of its reach."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import GratingModel

#: Side of a part of the picture, px, and by how much columns in it may exceed those at its corners, px.
PART_PX, MARGIN_PX = 32, 8.0


def may_reach(
    rig: Rig, order: int, pixels: Tensor, depth_mm: Tensor, lit: Tensor, ends_nm: NDArray[np.float64]
) -> Tensor:
    """Indices of those ``lit`` of pixels (P,), flat ones at depths (P,), that an order may reach; a few more.

    A part of the picture is within reach unless the columns of its corners, at its least and largest depth
    and both ends of the spectrum, are all to one side of the projector's picture.
    """
    width, height = rig.camera.width_px, rig.camera.height_px
    across, down = -(-width // PART_PX), -(-height // PART_PX)
    chosen = torch.nonzero(lit).ravel()
    seen = pixels[chosen]
    part = (seen // width // PART_PX) * across + seen % width // PART_PX
    limits = _limits(part, depth_mm[chosen], across * down)
    # Nothing is lit in parts without a depth.
    limits = torch.where(torch.isfinite(limits), limits, torch.full_like(limits, float(depth_mm.nanmedian())))
    low, high = _columns(rig, order, _corners(width, height).to(pixels.device), limits, ends_nm)
    reached = (high > -MARGIN_PX) & (low < rig.projector.width_px + MARGIN_PX)
    return chosen[reached[part]]


def _limits(part: Tensor, depth_mm: Tensor, parts: int) -> Tensor:
    """Least and largest depth of each part, (2, parts); infinite where there is none."""
    least = torch.full((parts,), torch.inf, device=depth_mm.device, dtype=depth_mm.dtype)
    return torch.stack(
        [least.scatter_reduce(0, part, depth_mm, "amin"), (-least).scatter_reduce(0, part, depth_mm, "amax")]
    )


def _corners(width: int, height: int) -> Tensor:
    """Flat indices of the pixels at the corners of each part, (4, parts)."""
    columns, rows = (
        [(at, min(at + PART_PX, size) - 1) for at in range(0, size, PART_PX)] for size in (width, height)
    )
    return torch.tensor(
        [[r[i] * width + c[j] for i in (0, 1) for j in (0, 1)] for r in rows for c in columns]
    ).T


def _columns(
    rig: Rig, order: int, corners: Tensor, limits_mm: Tensor, ends_nm: NDArray[np.float64]
) -> tuple[Tensor, Tensor]:
    """Smallest and largest column (px) at the corners of each part, (parts,)."""
    shape = len(limits_mm), *corners.shape
    at, depth = corners.expand(shape), limits_mm[:, None].expand(shape)
    columns = GratingModel(rig).exact(at.reshape(-1), depth.reshape(-1), order, ends_nm).columns
    columns = columns.reshape(-1, corners.shape[1])
    return columns.amin(0), columns.amax(0)
