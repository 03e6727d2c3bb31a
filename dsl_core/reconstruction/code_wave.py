"""The wave that a line spread which is off leaves in columns, as the binary code sees it.

Lines that lie side by side add up to the same light at every place, however wide they are: nothing in them
says how wide. A spread that is off displaces columns to or from the middles of lines. The code has fewer
places, but they do not depend on the lines: at each of its boundaries, pixels tell by how much columns are
displaced there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding, matters
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction.code_agreement import displacement, rms_beyond_chance
from dsl_core.reconstruction.columns.maps import ColumnMaps

Floats = NDArray[np.float64]

#: Columns that noise moves farther than this (px) gather at the middles of lines, which looks like a wave.
MOST_NOISE_PX = 0.1
#: How well a boundary must be known (px): less well, noise is taken for a wave.
TELLING_PX = 0.04
#: A wave (rms, px) that matters.
MOST_WAVE_PX = 0.04


@dataclass(frozen=True)
class CodeWave:
    """By how much columns are displaced away from the middles of lines, px, with deviations.

    Each value is of one boundary of the code to the right of a middle and its mirror image on the left.
    """

    away_px: Floats
    std_px: Floats

    @property
    def rms_px(self) -> float:
        """Root mean square of the wave, less what chance explains."""
        return rms_beyond_chance(self.away_px, self.std_px)[0]

    @property
    def rms_std_px(self) -> float:
        """Deviation of the root mean square."""
        return rms_beyond_chance(self.away_px, self.std_px)[1]

    @property
    def error_px(self) -> float:
        """What columns are off by, rms; 0 where that is little or chance explains it."""
        return self.rms_px if matters(self.rms_px, self.rms_std_px, MOST_WAVE_PX) else 0.0

    def finding(self) -> FitFinding:
        """What is told of it."""
        most_px = float(np.abs(self.away_px).max())
        return FitFinding.judged(
            "profile",
            "columns between lines against the binary code",
            (self.rms_px, self.rms_std_px),
            "px",
            MOST_WAVE_PX,
            f"Between the middles of lines, columns lie up to {most_px:.2f} px from where the binary code saw"
            " them: lines have another shape or width than calibrated, or light is not counted evenly."
            " Deviations of depth contain it.",
            "Repeat the self-test with the projector in focus. A plan whose lines overlap, like balanced,"
            " shows the shape of lines itself.",
        )


def code_wave(lines: LineSet | None, named_px: NDArray[np.integer], maps: ColumnMaps) -> CodeWave | None:
    """The wave of the columns in ``maps`` that lines refined.

    ``named_px``, of a shape with as many pixels, are the columns that a code names, negative where it names
    none. None for lines that overlap, which show their spread themselves, and for too few pixels.
    """
    if lines is None or not lines.single or lines.step_px < lines.width_px:
        return None
    named_px = named_px.ravel()
    known = maps.refined & ~maps.unusual & (named_px >= 0) & (maps.column_std_px < MOST_NOISE_PX)
    exact = maps.column_px[known].astype(np.float64)
    # Each place between two middles of the projector's pixels has one boundary of the code.
    place = np.floor(exact).astype(np.int64) % lines.step_px
    shift, std = displacement(named_px[known], exact, place, lines.step_px)
    left, right = _mirrored(lines)
    # What has moved displaces both sides alike, and cancels.
    away, away_std = (shift[left] - shift[right]) / 2, np.hypot(std[left], std[right]) / 2
    with np.errstate(invalid="ignore"):
        telling = np.maximum(std[left], std[right]) < TELLING_PX
    return CodeWave(away[telling], away_std[telling]) if telling.any() else None


def _mirrored(lines: LineSet) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Places left and right of the middle of a line whose boundaries are equally far from it, (pairs,)."""
    place = np.arange(lines.step_px)
    right_px = (place + 0.5 - lines.first_px) % lines.step_px
    right = place[(right_px > 0) & (right_px < lines.step_px / 2)]
    return np.asarray((round(2 * lines.first_px) - 1 - right) % lines.step_px), right
