"""At which distances targets stand: shares of the depths that a rig is for, within what its stage reaches."""

from __future__ import annotations

import numpy as np

from dsl_core.devices.base import Stage
from dsl_core.model.rig import Rig

#: Share of the depth range at which a single flat target stands.
USUAL = 0.4


def target_depth_mm(rig: Rig, wanted_mm: float | None) -> float:
    """Where a flat target stands: at ``wanted_mm``, or where the rig has most room before and behind it."""
    return float(np.round(depths_mm(rig, USUAL)[0])) if wanted_mm is None else wanted_mm


def depths_mm(rig: Rig, *shares: float) -> tuple[float, ...]:
    """Depths at these shares (0 near, 1 far) of the rig's depth range, mm."""
    low, high = rig.depth_range_mm
    return tuple(float(low + share * (high - low)) for share in shares)


def stage_depths_mm(rig: Rig, stage: Stage | None, near: float, far: float, count: int) -> tuple[float, ...]:
    """So many positions from one share of the depth range to another, whole mm, all of which a stage reaches.

    Where depths and stage have nothing in common, positions are in the figures of another origin, and the
    range of the stage alone counts.
    """
    low, high = depths_mm(rig, near, far)
    if stage is not None:
        first, last = stage.range_mm
        if first < high and low < last:
            low, high = max(low, first), min(high, last)
        else:
            low, high = first, last
    # Rounded to the inside: an end of the stage need not be a whole number.
    ends = np.ceil(low), np.floor(high)
    return tuple(float(np.round(each)) for each in np.linspace(*ends, count))
