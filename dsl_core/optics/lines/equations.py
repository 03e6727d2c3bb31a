"""Normal equations of single scan lines: a line lights only a few neighbouring bands through one order.

So their matrix is banded. Lines' light over a band comes from a table that pixels of like dispersion share.
With tensors, as a GPU needs them; `dsl_core.optics.lines.sums` is compiled and faster without one.
A pixel has one colour, that of its own filter; `dsl_core.optics.colour_neighbours` brings three together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor

from dsl_core.model.projector.line_spread import Spread, stretched
from dsl_core.optics.correspondence import like
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import SAMPLES, ProfileTable
from dsl_core.optics.spectra import Bands

#: How much closer than their mean spacing bands may be at least, because the response moves their centroids;
#: those of wide bands move by a third of a band.
CENTROID_SLACK_PX = 0.5
CLOSENESS_PIXELS = 256
#: Bands of usable first orders are never closer, px per nm; evanescent ones, far outside, may coincide.
MIN_DISPERSION = 0.1
#: Diagonals whose sum is below this share of the main one are left out.
DROPPED = 2e-5
#: What is added to the main diagonal at least, relative to it.
LEAST_SURPLUS = 1e-6
#: Bands that share one window of lines while the normal equations are added up.
GROUP = 3


#: A tabulated profile of a width, spread and half width of a band (px), shared by all that ask for it.
_table = lru_cache(maxsize=64)(ProfileTable)


def closeness_px(columns: Tensor, inside: Tensor, spacing_px: float, reach_px: float) -> float:
    """How much closer than their mean spacing any two bands come that overlap (px), at least the usual slack.

    ``columns`` and ``inside`` are (bands, pixels); bands farther apart than ``reach_px`` do not overlap.
    """
    slack = CENTROID_SLACK_PX
    # Bands shift alike at neighbouring pixels, so that some of them tell; fine bands have hundreds of pairs.
    some = slice(None, None, max(columns.shape[1] // CLOSENESS_PIXELS, 1))
    columns, inside = columns[:, some], inside[:, some]
    for apart in range(1, len(columns)):
        both = inside[apart:] & inside[:-apart]
        nearest = torch.where(both, (columns[apart:] - columns[:-apart]).abs(), torch.inf).amin()
        if float(nearest) > reach_px:
            break
        slack = max(slack, apart * spacing_px - float(nearest))
    return slack


@dataclass(frozen=True)
class OrderLines:
    """How the lines of one order light the bands of some pixels.

    ``columns`` (bands, pixels) are on the grid of the ``table``, so that a band has the same profile wherever
    it is looked up and the matrix is a true square. Diagonals beyond ``bandwidth`` may sum to half of
    ``dropped``, relative to the main one.
    """

    columns: Tensor
    table: ProfileTable
    bandwidth: int
    dropped: float

    @classmethod
    def of(
        cls, bands: Bands, lines: LineSet, spread: Spread, columns: Tensor, inside: Tensor, width: float
    ) -> OrderLines:
        """Those of ``columns`` that are ``inside`` (bands, pixels); ``width`` is that of the spread."""
        half = bands.half_width_px(columns)
        table = _table(lines.width_px, stretched(spread, width), half, columns.device, columns.dtype)
        columns = (columns * SAMPLES).round() / SAMPLES
        spacing = ((columns[-1] - columns[0]).abs().min() / (bands.count - 1)).clip(
            min=MIN_DISPERSION * bands.step_nm
        )
        slack = closeness_px(columns, inside, float(spacing), 2 * table.support_px)
        tails = table.overlaps(float(spacing), slack)[::-1].cumsum()[::-1]
        bandwidth = max(min(int((tails > DROPPED).sum()), bands.count - 1), 1)
        return cls(columns, table, bandwidth, 2 * float(tails[bandwidth:].max(initial=0)))


class LineEquations:
    """Adds the first orders of scan lines, one order and band at a time, over all pixels of a tile."""

    def __init__(
        self,
        bands: Bands,
        lines: LineSet,
        spread: Spread,
        colour: Tensor,
        other: Tensor,
        offsets: bool = False,
    ) -> None:
        """``spread`` is that of a line, ``colour`` (pixels,) 0 to 2 for red, green and blue.

        ``other`` gives device and precision; ``offsets`` adds up as well what an offset of all frames does.
        """
        self.bands, self.lines, self.spread, self.colour = bands, lines, spread, colour
        self.matrix = torch.zeros((1, bands.count, len(colour)), device=other.device, dtype=other.dtype)
        self.right = torch.zeros_like(self.matrix[0])
        #: Right side of an offset of one DN per ms, (bands, pixels), if it is asked for.
        self.offset = torch.zeros_like(self.right) if offsets else None
        #: Bound of the diagonals left out, relative to the main one.
        self.dropped = LEAST_SURPLUS
        #: Weighted sum of squares of the data that entered, and their number, (pixels,).
        self.square, self.samples = torch.zeros_like(self.right[0]), torch.zeros_like(self.right[0])

    def add(
        self,
        order: int,
        columns: Tensor,
        inside: Tensor,
        radiance: Tensor,
        weight: Tensor,
        first_line: int,
        width: float = 1.0,
    ) -> None:
        """Add one order: ``radiance`` and ``weight`` are (frames, pixels), frame 0 being ``first_line``.

        ``width`` is that of the spread relative to the usual one.

        Bands are taken in groups that share one window of lines, so that data are gathered once a group.
        """
        order_lines = OrderLines.of(self.bands, self.lines, self.spread, columns, inside, width)
        columns, table, bandwidth = order_lines.columns, order_lines.table, order_lines.bandwidth
        # What the left-out diagonals may sum to is added to the main one: a truncated matrix of bright pixels
        # would not be positive definite.
        self.dropped = max(self.dropped, order_lines.dropped)
        more = bandwidth + 1 - self.matrix.shape[0]
        if more > 0:
            self.matrix = torch.nn.functional.pad(self.matrix, (0, 0, 0, 0, 0, more))
        reached = [j for j, any_pixel in enumerate(inside.any(1).tolist()) if any_pixel]
        if not reached:
            return
        white = like(self.bands.moments[order].sum(1), columns)[self.colour].T.contiguous()
        masked = None if bool(inside[reached[0] : reached[-1] + 1].all()) else inside
        weighted = radiance * weight
        self._add_squares(columns, inside, radiance, weight, weighted, first_line, table.support_px)
        flat = weight.reshape(-1), weighted.reshape(-1)
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
        index = torch.arange(first_line, first_line + len(radiance), device=columns.device)[:, None]
        centre = self.lines.centre_px(index)
        used = ((centre > low) & (centre < high)).to(radiance.dtype)
        self.square += (weighted * radiance * used).sum(0)
        self.samples += ((weight > 0) * used).sum(0)

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
        count = len(flat[0]) // pixels
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
        weights, weighted = (values.index_select(0, index).reshape(window, pixels) for values in flat)
        relative = columns[group[0] : stop] - (start * self.lines.step_px + self.lines.first_px)
        profiles = table.at(relative[:, None] - (offsets * self.lines.step_px))
        profiles[: len(group)] *= valid
        if inside is not None:
            profiles *= inside[group[0] : stop, None]
        for i, j in enumerate(group):
            own = weights * profiles[i]
            if self.offset is not None:
                self.offset[j] += white[j] * own.sum(0)
            self.right[j] += white[j] * (weighted * profiles[i]).sum(0)
            reach = profiles[i : i + self.matrix.shape[0]]
            self.matrix[: len(reach), j] += white[j] * white[j : j + len(reach)] * (reach * own).sum(1)
