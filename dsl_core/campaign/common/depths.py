"""At which distances targets stand: shares of the depths that a rig is for, within what its stage reaches."""

from __future__ import annotations

import numpy as np

from dsl_core.devices.base import Stage
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import USUAL_DEPTH, Rig
from dsl_core.optics.pinhole import project

#: By this factor a flat target may stand nearer or farther than the depths that a rig is for.
BESIDE = 2.0
#: Shares of the depth range at which a flat target stands that is not seen as a whole where it usually does.
FARTHER = np.arange(USUAL_DEPTH + 0.05, 0.96, 0.05)


def target_depth_mm(rig: Rig, wanted_mm: float | None) -> float:
    """Where a flat target stands: at ``wanted_mm``, or where the rig has most room before and behind it.

    Raises `CalibrationError` for a distance far from those that the rig is for.
    """
    if wanted_mm is None:
        return rig.usual_depth_mm
    near, far = target_range_mm(rig)
    if not near < wanted_mm < far:
        low, high = rig.depth_range_mm
        raise CalibrationError(
            f"A target was requested at depth_mm={wanted_mm:g}; this rig is for {low:g} to {high:g} mm."
            " Choose a distance in between, or state another depth_range_mm in the rig's nominal figures."
        )
    return wanted_mm


def target_range_mm(rig: Rig) -> tuple[float, float]:
    """Between which distances a flat target counts as one: its plane is known beside the range as well."""
    low, high = rig.depth_range_mm
    return low / BESIDE, high * BESIDE


def seen_whole_mm(rig: Rig, size_mm: tuple[float, float]) -> float:
    """The usual depth of a flat target, or the nearest one behind it at which both devices see all of it.

    ``size_mm`` is (width, height) of what has to be seen, its middle on the camera's axis. The usual depth,
    too, where no depth of the rig shows all of it.
    """
    corners = np.array([[-0.5, 0.5, 0.5, -0.5], [-0.5, -0.5, 0.5, 0.5]]) * np.array(size_mm)[:, None]
    for depth in (rig.usual_depth_mm, *np.round(depths_mm(rig, *FARTHER))):
        points = np.vstack([corners, np.full(4, depth)])
        views = (rig.camera, points), (rig.projector, rig.pose.matrix @ points + rig.pose.vector_mm[:, None])
        inside = True
        for lens, seen in views:
            column, row = project(lens, *seen)
            inside &= bool((seen[2] > 0).all() and (np.minimum(column, row) > 0).all())
            inside &= bool((column < lens.width_px - 1).all() and (row < lens.height_px - 1).all())
        if inside:
            return float(depth)
    return rig.usual_depth_mm


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
