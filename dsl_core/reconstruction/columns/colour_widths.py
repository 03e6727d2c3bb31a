"""By how much lines of one colour are wider than those of another, as the scan itself shows it.

Few projectors focus red, green and blue at one distance. Each pixel of a mosaic sees mostly the light of one
LED: with one width for all, its columns get waves between two lines, of opposite signs in colours that are
wider and narrower than the mean. Lines that overlap show the width of each colour.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.figure import with_std
from dsl_core.model.fit import SIGMAS, FitFinding
from dsl_core.model.rig import Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.sensor import bayer_channels
from dsl_core.reconstruction.columns.column import MODEL_ERROR, PeakFit, fit_peaks
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.reconstruction.columns.line_spread import RUN
from dsl_core.solve.threads import one_kernel_thread

Floats = NDArray[np.float64]

#: Widths that are tried, relative to the usual one.
WIDTHS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.15, 1.3, 1.5, 1.7, 2.0)
#: Steps from the best of them, the longest of the logarithm of a width, and that of its derivative.
STEPS, LONGEST, STEP = 4, 0.15, 0.03
#: A difference from the usual width, as its logarithm, that is followed.
MOST_WIDER = 0.03
#: Pixels of a colour that say how wide its lines are, at least.
FEWEST = 200
#: Pixels whose chi-square is so many times the usual one see more than one surface, and count for less.
USUAL = 2.0
NAMES = ("red", "green", "blue")


@dataclass(frozen=True)
class ColourWidths:
    """Logarithms (3,) of widths of lines in each colour relative to the usual one, and ``std`` (3,)."""

    logs: Floats
    std: Floats

    @property
    def differ(self) -> bool:
        """Whether colours differ by what matters, and by more than chance."""
        narrow, wide = int(self.logs.argmin()), int(self.logs.argmax())
        apart = float(self.logs[wide] - self.logs[narrow])
        return apart > max(MOST_WIDER, SIGMAS * math.hypot(self.std[narrow], self.std[wide]))

    def of(self, rig: Rig) -> Rig:
        """The rig whose lines are as wide in each colour as the scan shows."""
        red, green, blue = np.exp(self.logs).tolist()
        own = rig.projector_response.model_copy(update={"colour_widths": (red, green, blue)})
        return rig.model_copy(update={"projector_response": own})

    def finding(self) -> FitFinding:
        """What is told of it."""
        narrow, wide = int(self.logs.argmin()), int(self.logs.argmax())
        wider = 100 * math.expm1(self.logs[wide] - self.logs[narrow])
        std = (100 + wider) * math.hypot(self.std[narrow], self.std[wide])
        found = FitFinding.judged(
            "profile",
            "width of lines by colour",
            (wider, std),
            "% of the width",
            100 * MOST_WIDER,
            f"Lines are wider by {with_std(wider, std, 1)} % in {NAMES[wide]} than in {NAMES[narrow]}: the"
            " projector does not focus all colours at one distance, or surfaces are translucent, which"
            " spreads red light most. Columns and depth of this result follow it.",
            "If a flat matt target shows it, too, focus the projector for green where the object is.",
        )
        return found.model_copy(update={"significant": self.differ})


def pixel_colours(rig: Rig, pixels: NDArray[np.intp]) -> NDArray[np.intp]:
    """Colours, 0 to 2, that pixels (n,) of a picture, flat indices, measure."""
    lens = rig.camera
    return np.asarray(bayer_channels(rig.sensor.bayer, lens.height_px, lens.width_px).ravel()[pixels])


@one_kernel_thread()
def colour_widths(peaks: LinePeaks, colours: NDArray[np.integer]) -> ColourWidths | None:
    """Widths of lines in each colour, of ``peaks`` whose pixels measure ``colours`` (pixels,), 0 to 2.

    None where lines do not overlap, which show no width, and where a colour has too few pixels.
    """
    if not _shows_widths(peaks.lines) or np.bincount(colours, minlength=3).min() < FEWEST:
        return None
    first = _step(peaks, np.zeros(3), colours)
    if first is not None and not first.differ:
        return first
    # Far from the width of a colour its squares are no parabola.
    tried = [np.log(width) for width in WIDTHS]
    squares = np.array([_usual_squares(peaks, each, colours) for each in tried])
    found = ColourWidths(np.array(tried)[squares.argmin(0)], np.full(3, np.inf))
    for _ in range(STEPS):
        nearer = _step(peaks, found.logs, colours)
        if nearer is None:
            break
        found = nearer
    return found


def _step(peaks: LinePeaks, logs: Floats, colours: NDArray[np.integer]) -> ColourWidths | None:
    """Widths after one step of Newton's method; None where a colour has no width that fits best."""
    slope, curve = _slopes(peaks, logs[colours])
    more, std = np.zeros(3), np.zeros(3)
    for colour in range(3):
        own = colours == colour
        total = float(curve[own].sum())
        if total <= 0:
            return None
        more[colour] = -float(slope[own].sum()) / total
        # Neighbours of a run lie on one surface, and err alike.
        left = np.where(own, slope + more[colour] * curve, 0.0).reshape(-1, RUN).sum(1)
        std[colour] = float(np.sqrt(np.sum(left**2))) / total
    return ColourWidths(logs + more.clip(-LONGEST, LONGEST), std)


def _shows_widths(lines: LineSet) -> bool:
    return lines.single and lines.step_px < lines.width_px


def _fit(peaks: LinePeaks, logs: Floats) -> PeakFit:
    """The peaks fitted with lines whose widths (pixels,) have these logarithms, relative to the usual."""
    base = torch.ones_like(peaks.coarse_px) if peaks.widths is None else peaks.widths
    return fit_peaks(replace(peaks, widths=base * torch.as_tensor(np.exp(logs)).to(base)), MODEL_ERROR)


def _usual_squares(peaks: LinePeaks, log: float, colours: NDArray[np.integer]) -> Floats:
    """Median chi-square of each colour (3,) with lines of a width."""
    squares = _fit(peaks, np.full(len(colours), log)).chi_square.numpy()
    return np.array([np.nanmedian(squares[colours == colour]) for colour in range(3)])


def _slopes(peaks: LinePeaks, logs: Floats) -> tuple[Floats, Floats]:
    """First and second derivative of each pixel's squares by the logarithm of its width, at ``logs``."""
    narrower, here, wider = (_fit(peaks, logs + change) for change in (-STEP, 0.0, STEP))
    squares = [each.chi_square.numpy().astype(np.float64) for each in (narrower, here, wider)]
    known = (here.used.numpy() > 3) & (here.amplitude.numpy() > 0) & np.isfinite(squares).all(0)
    low, middle, high = (np.where(known, each, 0.0) for each in squares)
    usual = USUAL * float(np.median(middle[known])) if known.any() else 1.0
    weight = np.where(known, usual / np.maximum(middle, max(usual, 1e-12)), 0.0)
    return weight * (high - low) / (2 * STEP), weight * (high - 2 * middle + low) / STEP**2
