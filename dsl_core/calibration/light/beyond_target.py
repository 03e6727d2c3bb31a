"""How well the camera's gain is known where the projector lights more than the target fills."""

from __future__ import annotations

from dsl_core.model.rig import FlatField, Rig
from dsl_core.optics.pinhole import pixel_rays, project
from dsl_core.optics.sensor import gain_at_pixels
from dsl_core.optics.shading import Plane


def unsure_gain(rig: Rig, plane: Plane, flat_field: FlatField, std: tuple[tuple[float, ...], ...]) -> float:
    """The largest deviation of the relative gain (mean one) in what the projector lights on a plane.

    ``std`` is that at the nodes of the ``flat_field``. Parts of the picture that the projector does not reach
    do not count: no scan sees anything there.
    """
    points = pixel_rays(rig.camera) * plane.depth_mm(rig)
    shape = points.shape[1:]
    in_projector = rig.pose.matrix @ points.reshape(3, -1) + rig.pose.vector_mm[:, None]
    column, row = (each.reshape(shape) for each in project(rig.projector, *in_projector))
    lit = (column > 0) & (column < rig.projector.width_px - 1)
    lit &= (row > 0) & (row < rig.projector.height_px - 1) & (in_projector[2] > 0).reshape(shape)
    unsure = gain_at_pixels(flat_field.model_copy(update={"gain": std}), *shape)
    return float(unsure[lit].max(initial=0.0))
