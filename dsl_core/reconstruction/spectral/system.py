"""The linear model of a pixel's spectrum, as weighted normal equations.

For reflectance H at internal bands, frame k and colour c of a pixel::

    y_ck = shading * sum_m sum_j response_mcj G(q_m(j) - x_k) H_j

with G the line's profile over a band. A line lights only a few neighbouring bands through one order,
so the normal matrix is banded; combs and free patterns couple distant bands and fill it.
Both orders add where both reach. Internal bands extend beyond the reported ones, because lines at the
ends also collect light from outside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import Footprint, like
from dsl_core.optics.image_formation import BlurredProfiles, ImageFormation, OrderPath
from dsl_core.optics.line_profile import SAMPLES, ProfileTable
from dsl_core.optics.spectra import hat_moments
from dsl_core.reconstruction.line_set import LineSet

ORDERS = (1, -1)
#: Orders of a few percent of the first: lines are too far away to mix with them, free patterns are not.
SECOND_ORDERS = (2, -2)
#: Internal bands beyond each end of the grid.
PAD_NM = 15.0
#: Tables of line profiles are shared by pixels whose dispersion agrees to this, px per nm.
SLOPE_STEP = 0.02
#: How much closer than their mean spacing bands may lie, because the response moves their centroids.
CENTROID_SLACK_PX = 0.5
#: Bands of usable first orders are never closer, px per nm; evanescent ones, far outside, may coincide.
MIN_DISPERSION = 0.1
#: Diagonals whose sum is below this share of the main one are left out.
DROPPED = 2e-5
#: Bands that share one window of lines while the normal equations are added up.
GROUP = 3


@dataclass(frozen=True)
class Bands:
    """Internal bands of a reconstruction and the response of each order there."""

    centres_nm: NDArray[np.float64]
    step_nm: float
    reported: slice
    moments: dict[int, NDArray[np.float64]]  # order -> (3 channels, 3 LEDs, bands), DN per ms
    centroids_nm: dict[int, NDArray[np.float64]]

    @classmethod
    def of(cls, rig: Rig, grid: WavelengthGrid) -> Bands:
        """Extend a grid and integrate the rig's response over its bands."""
        pad = math.ceil(PAD_NM / grid.step_nm)
        step = grid.step_nm
        centres = np.asarray(grid.start_nm + step * np.arange(-pad, grid.count + pad), np.float64)
        moments, centroids = {}, {}
        for order in (0, *ORDERS, *SECOND_ORDERS):
            moments[order], centroids[order] = hat_moments(rig, order, centres, step)
        return cls(centres, step, slice(pad, pad + grid.count), moments, centroids)

    @property
    def count(self) -> int:
        """Number of internal bands."""
        return len(self.centres_nm)

    @property
    def orders(self) -> tuple[int, ...]:
        """First orders, and second ones where the rig knows their efficiency."""
        return ORDERS + tuple(m for m in SECOND_ORDERS if self.moments[m].any())


@lru_cache(maxsize=64)
def _table(
    width_px: float, blur_px: float, band_px: float, device: torch.device, dtype: torch.dtype
) -> ProfileTable:
    return ProfileTable(width_px, blur_px, band_px, device, dtype)


def profile_table(
    rig: Rig, width_px: float, band_px: float, other: Tensor, extra_blur_px: float = 0.0
) -> ProfileTable:
    """Shared table of the line profile over a band of a given half width (px)."""
    blur = math.hypot(rig.projector_response.blur_px, extra_blur_px)
    return _table(width_px, round(blur, 2), band_px, other.device, other.dtype)


def band_halfwidth_px(columns: Tensor, step_nm: float, internal_nm: NDArray[np.float64]) -> float:
    """Half width (px) of a band's triangle: mean dispersion of some pixels, in shared steps."""
    slope = float((columns[-1] - columns[0]).abs().mean()) / float(internal_nm[-1] - internal_nm[0])
    return max(round(slope / SLOPE_STEP), 1) * SLOPE_STEP * step_nm


class BandedAccumulator:
    """Adds the first orders of scan lines, one order and band at a time, over all pixels of a tile."""

    def __init__(
        self, rig: Rig, bands: Bands, lines: LineSet, pixels: int, other: Tensor, offsets: bool = False
    ) -> None:
        """``offsets`` adds up as well what an offset of all frames does to the right side."""
        self.rig, self.bands, self.lines = rig, bands, lines
        self.matrix = torch.zeros((1, bands.count, pixels), device=other.device, dtype=other.dtype)
        self.right = torch.zeros_like(self.matrix[0])
        #: Right side of an offset of one DN per ms in each colour, (3, bands, pixels), if it is asked for.
        self.offset = torch.zeros((3, bands.count, pixels)).to(other) if offsets else None
        #: Bound of the diagonals left out, relative to the main one.
        self.dropped = 1e-6
        #: Weighted sum of squares of the data that entered, and their number, (pixels,).
        self.square, self.samples = torch.zeros_like(self.right[0]), torch.zeros_like(self.right[0])

    def frames(self, footprint: Footprint, inside: Tensor) -> range:
        """Frames that light any band of any pixel of the tile through an order; empty when none does."""
        columns = footprint.columns[inside]
        if len(columns) == 0:
            return range(0)
        margin = self.lines.width_px / 2 + 8
        low, high = float(columns.min()) - margin, float(columns.max()) + margin
        first, last = ((x - self.lines.first_px) / self.lines.step_px for x in (low, high))
        return range(max(math.floor(first), 0), min(math.ceil(last) + 1, self.lines.lines))

    def add(
        self,
        order: int,
        columns: Tensor,
        inside: Tensor,
        radiance: Tensor,
        weight: Tensor,
        first_line: int,
        blur_px: float,
    ) -> None:
        """Add one order: ``radiance`` and ``weight`` are (3, frames, pixels), frame 0 being ``first_line``.

        Bands are taken in groups that share one window of lines, so that data are gathered once a group.
        """
        half = band_halfwidth_px(columns, self.bands.step_nm, self.bands.centres_nm)
        table = profile_table(self.rig, self.lines.width_px, half, columns, blur_px)
        # On the table's grid a band has the same profile in every group, and the matrix is a true square.
        columns = (columns * SAMPLES).round() / SAMPLES
        spacing = ((columns[-1] - columns[0]).abs().min() / (self.bands.count - 1)).clip(
            min=MIN_DISPERSION * self.bands.step_nm
        )
        tails = table.overlaps(float(spacing), CENTROID_SLACK_PX)[::-1].cumsum()[::-1]
        bandwidth = max(min(int((tails > DROPPED).sum()), self.bands.count - 1), 1)
        # What the left-out diagonals may sum to is added to the main one: a truncated matrix of bright pixels
        # would not be positive definite.
        self.dropped = max(self.dropped, 2 * float(tails[bandwidth:].max(initial=0)))
        if self.matrix.shape[0] < bandwidth + 1:
            self.matrix = torch.nn.functional.pad(
                self.matrix, (0, 0, 0, 0, 0, bandwidth + 1 - self.matrix.shape[0])
            )
        reached = [j for j, any_pixel in enumerate(inside.any(1).tolist()) if any_pixel]
        if not reached:
            return
        white = like(self.bands.moments[order].sum(1), columns)
        masked = None if bool(inside[reached[0] : reached[-1] + 1].all()) else inside
        weighted = radiance * weight
        self._add_squares(columns, inside, radiance, weight, weighted, first_line, table.support_px)
        flat = weight.reshape(3, -1), weighted.reshape(3, -1)
        for start in range(reached[0], reached[-1] + 1, GROUP):
            group = range(start, min(start + GROUP, reached[-1] + 1))
            stop = min(group[-1] + bandwidth, reached[-1]) + 1
            self._add_group(group, stop, columns, masked, white, flat, first_line, table)

    def positive_matrix(self) -> Tensor:
        """The banded matrix of unit shading, made safe against what its bandwidth leaves out."""
        matrix = self.matrix.clone()
        matrix[0] *= 1 + self.dropped
        return matrix

    def _add_squares(
        self,
        columns: Tensor,
        inside: Tensor,
        radiance: Tensor,
        weight: Tensor,
        weighted: Tensor,
        first_line: int,
        support_px: float,
    ) -> None:
        low = torch.where(inside, columns, torch.inf).amin(0) - support_px
        high = torch.where(inside, columns, -torch.inf).amax(0) + support_px
        index = torch.arange(first_line, first_line + radiance.shape[1], device=columns.device)[:, None]
        centre = self.lines.centre_px(index)
        used = ((centre > low) & (centre < high)).to(radiance.dtype)
        for c in range(3):
            self.square += (weighted[c] * radiance[c] * used).sum(0)
            self.samples += ((weight[c] > 0) * used).sum(0)

    def _add_group(
        self,
        group: range,
        stop: int,
        columns: Tensor,
        inside: Tensor | None,
        white: Tensor,
        flat: tuple[Tensor, Tensor],
        first_line: int,
        table: ProfileTable,
    ) -> None:
        pixels = columns.shape[1]
        count = flat[0].shape[1] // pixels
        ends = columns[[group[0], group[-1]]]
        lowest, span = ends.amin(0), float((ends[1] - ends[0]).abs().max())
        window = math.ceil((span + 2 * table.support_px) / self.lines.step_px) + 1
        offsets = torch.arange(window, device=columns.device, dtype=torch.int32)[:, None]
        start = ((lowest - table.support_px - self.lines.first_px) / self.lines.step_px).ceil().int()
        frame = (start - first_line) + offsets
        valid = (frame >= 0) & (frame < count)
        index = (
            frame.clip_(0, count - 1) * pixels
            + torch.arange(pixels, device=columns.device, dtype=torch.int32)
        ).reshape(-1)
        weights, weighted = (values.index_select(1, index) for values in flat)
        relative = columns[group[0] : stop] - (start * self.lines.step_px + self.lines.first_px)
        profiles = table.at(relative[:, None] - (offsets * self.lines.step_px))
        profiles[: len(group)] *= valid
        if inside is not None:
            profiles *= inside[group[0] : stop, None]
        for i, j in enumerate(group):
            own = profiles[i]
            if self.offset is not None:
                self.offset[:, j] += (white[:, j, None, None] * weights.reshape(3, window, pixels) * own).sum(
                    1
                )
            self.right[j] += ((white[:, j] @ weighted).reshape(window, pixels) * own).sum(0)
            reach = profiles[i : i + self.matrix.shape[0]]
            pairs = (white[:, j, None] * white[:, j : j + len(reach)]).T
            mixed = (pairs @ weights).reshape(len(reach), window, pixels)
            mixed *= own
            mixed *= reach
            self.matrix[: len(reach), j] += mixed.sum(1)


def dense_equations(
    response: ProjectorResponse,
    bands: Bands,
    profiles: NDArray[np.float64],
    column_px: Tensor,
    footprints: dict[int, Footprint],
    inside: dict[int, Tensor],
    radiance: Tensor,
    weight: Tensor,
    offset_variance: Tensor,
) -> tuple[Tensor, Tensor, Tensor]:
    """Normal equations of unit shading for any pattern set.

    Full matrix (pixels, bands, bands), right side (pixels, bands) and weighted sum of squares (pixels,).
    ``profiles`` (frames, width, LEDs) are radiances relative to full drive; ``radiance`` and ``weight`` are
    (3, frames, pixels), ``offset_variance`` (3, pixels) that of an offset which the frames of a colour share.
    The zero order is part of the model, as patterns may light a pixel by several orders at once.
    """
    everywhere = torch.ones_like(column_px[None], dtype=torch.bool)
    paths = [OrderPath(column_px[None], everywhere, bands.moments[0], 0.0)]
    for order, footprint in footprints.items():
        half = band_halfwidth_px(footprint.columns, bands.step_nm, bands.centres_nm)
        paths.append(OrderPath(footprint.columns, inside[order], bands.moments[order], half))
    model = ImageFormation(response, profiles, paths, torch.ones_like(column_px)).matrix()
    w, y = (values.permute(2, 0, 1)[..., None] for values in (weight, radiance))
    flat, y = (without_offset(values, w, offset_variance.T).flatten(1, 2) for values in (model, y))
    w = w.flatten(1, 2)
    weighted = flat * w
    return weighted.mT @ flat, (weighted.mT @ y)[..., 0], (w * y * y).sum((1, 2))


def without_offset(values: Tensor, weight: Tensor, variance: Tensor) -> Tensor:
    """Values (..., frames, n) less as much of their mean as an unknown offset of all frames takes of it.

    ``weight`` (..., frames, 1) is theirs, ``variance`` (...) the offset's. The normal equations of such a
    model and such data are those with the offset as one more unknown, eliminated, and stay positive in any
    precision.
    """
    total = weight.sum(-2, keepdim=True)
    mean = (weight * values).sum(-2, keepdim=True) / total.clip(min=1e-30)
    share = 1 - (1 + variance[..., None, None] * total).rsqrt()
    return values - share * mean


def direct_light(light: BlurredProfiles, bands: Bands, column_px: Tensor, colour: Tensor) -> Tensor:
    """Largest zero-order light within a column of each pixel's, (3, frames, pixels), DN per ms.

    The edges of lines are where a small error of the column or the blur matters most. ``colour`` (3, pixels)
    is the zero order under white; grey patterns may be given as one LED.
    """
    lit = torch.stack([light.at(column_px + shift) for shift in (-1.0, 0.0, 1.0)]).amax(0)
    parts = colour[:, None] if lit.shape[1] == 1 else _by_led(bands, colour)
    return torch.einsum("clp,plf->cfp", parts, lit)


def _by_led(bands: Bands, colour: Tensor) -> Tensor:
    """Zero-order colour (3, pixels) as what each LED adds, (3, LEDs, pixels).

    An LED that is dark at a pixel's column spoils none of its frames. Reflectance counts as constant over the
    light of one LED.
    """
    white = like(bands.moments[0].sum(2), colour)
    reflectance = (torch.linalg.pinv(white) @ colour).clip(min=0)
    parts: Tensor = white[:, :, None] * reflectance
    return parts
