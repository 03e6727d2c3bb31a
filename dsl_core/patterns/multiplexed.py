"""Pattern sets of any kind as profiles over projector columns, 0..1 of the setting's drive level."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.plan import Columns, NoSpectral, SpectralSet
from dsl_core.patterns.scanlines import line_count, line_profile


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
            " drive levels lie between 0 and 1."
        )
    return levels
