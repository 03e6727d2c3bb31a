"""Pattern sets of any kind as profiles over projector columns, 0..1 of the setting's drive level."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.plan import Columns, LineComb, NoSpectral, ScanLines, SpectralSet


def profile_count(spec: SpectralSet, width_px: int) -> int:
    """Frames of a pattern set; raises `PlanError` when it does not fit ``width_px`` columns."""
    match spec:
        case NoSpectral():
            return 0
        case Columns():
            return len(spec.levels)
    return line_count(spec, width_px)


def profile(spec: SpectralSet, width_px: int, index: int) -> NDArray[np.float32]:
    """Drive levels of frame ``index`` over the columns, shape (width, 3) = R, G, B, in 0..1.

    Raises `PlanError` for an index outside the set, or a set that does not fit the projector.
    """
    count = profile_count(spec, width_px)
    if not 0 <= index < count:
        raise PlanError(
            f"Frame {index} of the spectral patterns does not exist: there are {count},"
            " counted from 0. Use the shots of the plan."
        )
    if isinstance(spec, Columns):
        return _own_profile(spec, width_px, index)
    if isinstance(spec, NoSpectral):  # count is 0, so that this is never reached
        raise PlanError("The plan has no spectral patterns.")
    return line_profile(spec, width_px, index)


def profiles(spec: SpectralSet, width_px: int) -> NDArray[np.float32]:
    """All profiles of a pattern set, shape (frames, width, 3), 0..1; raises `PlanError`."""
    count = profile_count(spec, width_px)
    if count == 0:
        raise PlanError("The plan has no spectral patterns. Plan lines, a comb, or profiles in 'levels'.")
    return np.stack([profile(spec, width_px, i) for i in range(count)])


def _own_profile(spec: Columns, width_px: int, index: int) -> NDArray[np.float32]:
    levels = np.array(spec.levels[index], np.float32)
    if levels.shape != (width_px, 3):
        raise PlanError(
            f"Column profile {index} has {len(spec.levels[index])} columns, the projector has {width_px}."
            " Give one (R, G, B) triple per projector column."
        )
    if levels.min() < 0 or levels.max() > 1:
        raise PlanError(
            f"Column profile {index} ranges from {levels.min():g} to {levels.max():g};"
            " drive levels are between 0 and 1."
        )
    return levels


def check_lines(spec: ScanLines | LineComb, width_px: int) -> None:
    """Raise `PlanError` when lines leave columns dark unasked or do not fit a projector of ``width_px``.

    Fewer than ``step_px`` columns at the right edge may stay dark: the published 318 lines leave
    the last of 640 columns so.
    """
    sparse = isinstance(spec, ScanLines) and spec.sparse
    if spec.step_px > spec.width_px and not sparse:
        raise PlanError(
            f"Lines {spec.width_px} px wide every {spec.step_px} px leave columns between them dark."
            f" Choose a step of at most {spec.width_px} px or wider lines."
        )
    if spec.width_px > width_px:
        raise PlanError(
            f"Lines {spec.width_px} px wide do not fit a projector of {width_px} columns."
            " Choose narrower lines."
        )
    if isinstance(spec, LineComb) and spec.period_px > width_px:
        raise PlanError(
            f"A comb with a period of {spec.period_px} px has at most one line on a projector of"
            f" {width_px} columns. Choose a shorter period, or single lines (kind 'lines')."
        )


def line_count(spec: ScanLines | LineComb, width_px: int) -> int:
    """Frames of the pattern set on a projector of ``width_px`` columns; raises `PlanError`."""
    check_lines(spec, width_px)
    if isinstance(spec, LineComb):
        return -(-spec.period_px // spec.step_px)
    return (width_px - spec.width_px) // spec.step_px + 1


def line_profile(spec: ScanLines | LineComb, width_px: int, index: int) -> NDArray[np.float32]:
    """Profile of frame ``index``, shape (width, 3), 0 or 1.

    A single line covers columns ``[step*index, step*index + width)``; a comb lights every column x
    with ``(x - step*index) mod period < width``, each LED at its own shift. Raises `PlanError` when
    the lines do not fit.
    """
    check_lines(spec, width_px)
    offset = np.repeat(np.arange(width_px)[:, None] - spec.step_px * index, 3, axis=1)
    if isinstance(spec, LineComb):
        offset = (offset - np.array(spec.shifts_px)) % spec.period_px
    lit = (offset >= 0) & (offset < spec.width_px)
    return lit.astype(np.float32)
