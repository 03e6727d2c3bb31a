"""What columns may be off by because nobody knows the line spread better.

A spread that is off moves columns by as much as it moves them between two lines. Lines that overlap show the
spread themselves; those that do not leave it to the calibration, and the focus of a projector changes from
day to day.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spread.fit import SpreadFit
from dsl_core.reconstruction.columns.column import refine
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.solve.threads import one_kernel_thread

#: Relative deviation of the width of the spread from its calibration, before a scan is seen.
FOCUS_STD = 0.06
#: A width that is surer than this moves no column by as much as anybody minds.
SURE = 0.003
#: By how much the width is changed to see what moves, and places between two lines that are told apart.
STEP, PLACES = 0.03, 16
#: No column moves farther than this with the width, px for a width twice as large.
LARGEST_PX = 3.0


@dataclass(frozen=True)
class SpreadDoubt:
    """What columns are off by at ``PLACES`` places between two lines, the first on the middle of one.

    ``relative`` is the deviation of the width. With a width twice as large, columns of these places would
    move by ``moved_px`` (PLACES,) on average, and by ``rms_px`` (PLACES,) rms. ``varies`` is what the width
    of each pixel (pixels,) is off by, relative to the one for all; None where that is little.
    """

    lines: LineSet
    relative: float
    moved_px: NDArray[np.float64]
    rms_px: NDArray[np.float64]
    varies: NDArray[np.float64] | None = None

    def at(self, column_px: NDArray[np.floating]) -> NDArray[np.float32]:
        """Deviation at columns, px; 0 where they are NaN. Of any shape, or (pixels,) where widths vary."""
        place = _places(self.lines, torch.as_tensor(np.nan_to_num(column_px)))
        relative = self.relative if self.varies is None else np.hypot(self.relative, self.varies)
        std_px = relative * self.rms_px[place.numpy()]
        return np.where(np.isfinite(column_px), std_px, 0.0).astype(np.float32)

    @property
    def is_sure(self) -> bool:
        """Whether widths are known so well that they move no column by as much as anybody minds."""
        return self.relative < SURE and self.varies is None

    def moved_at(self, off_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """By how much columns so far (n,) to the right of a line's middle would move, px."""
        step_px = self.lines.step_px
        return np.interp(off_px, step_px / PLACES * np.arange(PLACES), self.moved_px, period=step_px)


def spread_doubt(peaks: LinePeaks | None, found: SpreadFit | None) -> SpreadDoubt | None:
    """How far columns move with a width that is neither calibrated nor ``found`` any better.

    None without peaks, where single lines do not cover the picture. Where it is known well enough, parts of
    the picture may still differ (see `code_wave.with_varying_width`).
    """
    if peaks is None:
        return None
    lines, relative = peaks.lines, FOCUS_STD
    # Of lines side by side that look as calibrated, columns explain all that another width would change.
    if found is not None and (found.changed or lines.step_px < lines.width_px):
        seen = found.rms_std_px / found.response.blur_px
        relative *= seen / float(np.hypot(FOCUS_STD, seen))
    with one_kernel_thread():
        usual, wider = refine(peaks), refine(peaks.wider(1 + STEP))
    both = usual.refined & wider.refined
    place = _places(lines, usual.column_px[both]).numpy()
    moved = ((wider.column_px - usual.column_px)[both] / STEP).numpy().clip(-LARGEST_PX, LARGEST_PX)
    count = np.bincount(place, minlength=PLACES)
    mean, square = (np.bincount(place, each, PLACES) / np.maximum(count, 1) for each in (moved, moved**2))
    # Where no column is, lines say nothing: neighbours stand for it.
    square[count == 0] = square[count > 0].max(initial=0.0)
    return SpreadDoubt(lines, relative, mean, np.sqrt(square))


def _places(lines: LineSet, column_px: torch.Tensor) -> torch.Tensor:
    """Which of the places between two lines columns are at."""
    nearest = lines.centre_px(lines.nearest(column_px)).to(column_px.dtype)
    return ((column_px - nearest) / lines.step_px * PLACES).round().long() % PLACES
