"""Columns that no edge of a line tells, where a sharp projector shows lines edge to edge."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.plan import CapturePlan, LineComb, ScanLines
from dsl_core.model.result import DEPTH_INVALID, Flag
from dsl_core.reconstruction.findings.flag_findings import FEWEST, in_areas

#: Share of the pixels, here and there, whose columns may be those of the binary code.
MOST_BETWEEN = 0.15
#: A line that is so many times as wide as its edges are blurred (rms) looks alike in its middle. Where lines
#: are narrower, columns are not refined for other reasons, such as surfaces that reflect few wavelengths.
SHARP = 11.0


def edge_findings(plan: CapturePlan, flags: NDArray[np.integer], blur_px: float) -> Iterator[FitFinding]:
    """What flags (rows, columns) say of lines that do not overlap; nothing of others.

    ``blur_px`` is that of the projector (rms). Whole areas without refined columns have other reasons and are
    told elsewhere.
    """
    lines = plan.spectral
    if not isinstance(lines, ScanLines | LineComb) or lines.step_px < lines.width_px:
        return
    if lines.width_px < SHARP * blur_px:
        return
    measured = (flags & int(Flag.NO_LIGHT | DEPTH_INVALID)) == 0
    if np.count_nonzero(measured) < FEWEST:
        return
    coarse = measured & ((flags & int(Flag.NOT_REFINED | Flag.SATURATED)) == int(Flag.NOT_REFINED))
    between = np.count_nonzero(coarse) - in_areas(coarse, measured)
    share = between / np.count_nonzero(measured)
    yield FitFinding.judged(
        "profile",
        "columns between edges of lines",
        share,
        "share",
        MOST_BETWEEN,
        f"In {share:.0%} of the pixels, here and there, the binary code alone tells the column: the projector"
        " is so sharp that the middle of a line looks alike everywhere, and lines do not overlap.",
        "Depth is coarse there, as stated. Scan with lines that overlap, as in the plan Balanced.",
    )
