"""The light of scan lines around the decoded columns of some pixels, as columns are refined from it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import LineTable
from dsl_core.optics.spread.field import widths_at
from dsl_core.optics.unlit import unlit_px
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.reconstruction.columns.dark_offset import dark_offset
from dsl_core.reconstruction.columns.line_spread import Pickable, bright_runs, spread_pixels
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.solve.threads import one_kernel_thread

#: Frames on either side of a peak that are looked at where lines leave nothing out.
FEWEST_BESIDE = 2
#: So many rms widths of the line spread from an edge there is a slope to measure.
SLOPE_WIDTHS = 2.0
#: Fewer pixels of combs do not say how far off their peaks are.
FEWEST_PIXELS = 300


@dataclass(frozen=True)
class LinePeaks:
    """Decoded columns of some pixels, ``coarse_px`` (pixels,) float, and what lines brought to them.

    ``radiance`` and ``std`` (frames, pixels) are in DN per ms, infinite where saturated; ``widths`` (pixels,)
    are those of the line spread relative to the response's, None where they are the same. ``offset``
    (pixels,) is light that all line frames have alike, None where there is none.
    """

    coarse_px: Tensor
    radiance: Tensor
    std: Tensor
    lines: LineSet
    response: ProjectorResponse
    widths: Tensor | None = None
    offset: Tensor | None = None

    def some(self, pixels: Tensor) -> LinePeaks:
        """Those of some pixels, by their indices."""
        return replace(
            self,
            coarse_px=self.coarse_px[pixels],
            radiance=self.radiance[:, pixels],
            std=self.std[:, pixels],
            widths=None if self.widths is None else self.widths[pixels],
            offset=None if self.offset is None else self.offset[pixels],
        )

    def without_offset(self, unlit_px: tuple[float, float]) -> LinePeaks:
        """The same light without what frames have in which no order lights a pixel (see `dark_offset`).

        Light that lenses scatter, or a black frame's own noise, would pass for tails of the lines. Where a
        frame of the peak is saturated nobody knows yet how bright its halo is, and nothing is taken off.
        """
        y, variance, _ = self.window()
        offset, std = dark_offset(
            self.coarse_px, y.amax(0), self.radiance, self.std, self.lines, self.response, unlit_px
        )
        known = torch.isfinite(std) & torch.isfinite(variance).all(0)
        return replace(self, offset=torch.where(known, offset, 0.0))

    def wider(self, by: float) -> LinePeaks:
        """The same light, for a line spread so many times as wide."""
        return replace(self, widths=by * self._relative_widths())

    def table(self, columns_px: Tensor, reach_px: float) -> LineTable:
        """The profile of a line around columns (pixels,), as far from it as the reach."""
        return LineTable(self.lines.width_px, self.response, reach_px, columns_px, self.widths)

    @property
    def leaves_gaps(self) -> bool:
        """Whether between the edges of all lines there are places that no slope reaches."""
        past = self.lines.width_px % self.lines.step_px
        widest_px = max(past, self.lines.step_px - past)
        return bool(widest_px / 2 > SLOPE_WIDTHS * self.response.blur_px)

    def saturated(self) -> Tensor:
        """Which pixels have a saturated frame around their peak, (pixels,)."""
        return torch.isinf(torch.gather(self.std, 0, self.lines.frame(self._beside()))).any(0)

    def _beside(self) -> Tensor:
        """Virtual lines around the peak, (window, pixels)."""
        widest_px = self.response.blur_px * (1.0 if self.widths is None else float(self.widths.max()))
        half = math.ceil((self.lines.width_px / 2 + 3 * widest_px + 1) / self.lines.step_px)
        if self.lines.step_px <= self.lines.width_px:
            # However sharp lines are: that the next ones are dark is what says where the edge is.
            half = max(half, FEWEST_BESIDE)
        offsets = torch.arange(-half, half + 1, device=self.coarse_px.device)[:, None]
        return self.lines.nearest(self.coarse_px) + offsets

    def window(self) -> tuple[Tensor, Tensor, Tensor]:
        """Values, variances and line centres (px) of the frames around the peak, each (window, pixels)."""
        line = self._beside()
        frame = self.lines.frame(line)
        y = torch.gather(self.radiance, 0, frame)
        variance = torch.gather(self.std, 0, frame).to(y.dtype) ** 2
        usable = self.lines.exists(line) & torch.isfinite(variance) & torch.isfinite(y)
        variance = torch.where(usable, variance, torch.inf)
        if self.offset is not None:
            y = y - self.offset
        return torch.where(usable, y, 0.0), variance, self.lines.centre_px(line).to(self.coarse_px.dtype)

    def _relative_widths(self) -> Tensor:
        return torch.ones_like(self.coarse_px) if self.widths is None else self.widths


@one_kernel_thread()
def smooth_peaks(
    rig: Rig, lines: LineSet | None, code: DecodedCode, white: MergedFrame, stack: Pickable
) -> LinePeaks | None:
    """The peaks of bright pixels on smooth surfaces; None where single lines do not cover the picture."""
    pixels = spread_pixels(lines, code, white)
    return None if lines is None or pixels.size == 0 else _peaks_of(rig, lines, pixels, code, stack)


@one_kernel_thread()
def comb_peaks(
    rig: Rig, lines: LineSet | None, code: DecodedCode, white: MergedFrame, stack: Pickable
) -> LinePeaks | None:
    """The same for combs; None for other patterns, and where too few pixels are bright."""
    if lines is None or lines.single:
        return None
    pixels = bright_runs(code, white)
    return _peaks_of(rig, lines, pixels, code, stack) if pixels.size >= FEWEST_PIXELS else None


def _peaks_of(
    rig: Rig, lines: LineSet, pixels: NDArray[np.intp], code: DecodedCode, stack: Pickable
) -> LinePeaks:
    """The peaks of some pixels (flat indices), without their dark offset."""
    seen = stack.pick(pixels)
    column = torch.as_tensor(code.likely_column.ravel()[pixels].astype(np.float64))
    y, std = (torch.as_tensor(values.astype(np.float64)) for values in (seen.radiance, seen.std))
    widths = widths_at(rig, torch.as_tensor(pixels), column)
    peaks = LinePeaks(column, y, std, lines, rig.projector_response, widths)
    return peaks.without_offset(unlit_px(rig, lines.width_px))
