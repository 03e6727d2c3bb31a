"""How much of the projector's light surfaces send to the camera, whatever the pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.sensor import relative_gain
from dsl_core.simulation.scenes.truth import SceneTruth


def surface_shading(rig: Rig, truth: SceneTruth, shaded: bool = True) -> NDArray[np.float64]:
    """Cosine of incidence times inverse square distance times gain, zero in shadow, (rows, columns).

    Without ``shaded``, what is lit is lit like a surface at the reference distance facing the projector.
    """
    if not shaded:
        return np.asarray(truth.lit * relative_gain(rig))
    points = pixel_rays(rig.camera) * np.nan_to_num(truth.depth_mm, nan=1.0)
    to_light = rig.pose.projector_centre_mm[:, None, None] - points
    distance = np.linalg.norm(to_light, axis=0)
    cosine = (np.nan_to_num(truth.normals) * to_light).sum(0) / distance
    light = cosine.clip(min=0) * (rig.reference_distance_mm / distance) ** 2 * truth.lit
    return np.asarray(light * relative_gain(rig))
