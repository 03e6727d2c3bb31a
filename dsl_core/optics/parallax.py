"""How much depth a column of the projector stands for: what a rig's geometry makes of the columns' errors.

Codes tell columns alone. A camera above or below the projector sees the same column at every depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens, Pose
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import project, rays_at

#: By how many columns a point moves at least that is farther away by a hundredth.
LEAST_PX = 0.25
#: About so many pixels are asked.
MOST_PIXELS = 500


@dataclass(frozen=True)
class Parallax:
    """Depth (mm) that a column stands for, median of a picture, and the most that is still usual."""

    mm_per_column: float
    most_mm: float

    @property
    def is_small(self) -> bool:
        """Whether depth depends so little on columns that it is hardly measured."""
        return self.mm_per_column > self.most_mm

    @property
    def sentence(self) -> str:
        """What a column stands for, and why."""
        return (
            f"A column of the projector stands for {self.mm_per_column:.0f} mm of depth, more than"
            f" {self.most_mm:.0f} mm: camera and projector stand one above the other, along the stripes, or"
            " close together, so that small errors of columns are large ones of depth, as stated."
        )

    @property
    def advice(self) -> str:
        """What to do about it."""
        return (
            "Move the camera to the side, across the stripes, or turn the projector and its film by 90°, so"
            " that stripes lie across the line from it to the camera; then calibrate again."
        )


def parallax_of(rig: Rig, depth_mm: NDArray[np.floating] | None = None) -> Parallax:
    """The parallax of a rig at the depths (rows, columns) of its camera's picture, NaN where there is none.

    In the middle of the rig's depths where none are given.
    """
    known = None if depth_mm is None else np.flatnonzero(np.isfinite(depth_mm))
    if depth_mm is None or known is None or not known.size:
        return parallax_at(rig.camera, rig.projector, rig.pose, float(np.mean(rig.depth_range_mm)))
    some = known[:: max(1, known.size // MOST_PIXELS)]
    depth = depth_mm.ravel()[some].astype(np.float64)
    return _parallax(rig.camera, rig.projector, rig.pose, some, depth)


def parallax_at(camera: Lens, projector: Lens, pose: Pose, depth_mm: float) -> Parallax:
    """The parallax of lenses, all over the camera's picture, at a depth.

    The window asks at every change of a plan: no array of the picture's size is made for it.
    """
    size = camera.width_px * camera.height_px
    some = np.arange(0, size, max(1, size // MOST_PIXELS))
    return _parallax(camera, projector, pose, some, np.full(some.size, depth_mm))


def _parallax(
    camera: Lens, projector: Lens, pose: Pose, pixels: NDArray[np.intp], depth_mm: NDArray[np.float64]
) -> Parallax:
    """The parallax at the depths (n,) of pixels (flat indices, (n,))."""
    rows, columns = np.divmod(pixels, camera.width_px)
    points = rays_at(camera, columns.astype(float), rows.astype(float)) * depth_mm
    near, far = (
        project(projector, *(pose.matrix @ (points * by) + pose.vector_mm[:, None]))[0]
        for by in (0.995, 1.005)
    )
    one_percent_mm = 0.01 * float(np.median(depth_mm))
    moved_px = max(float(np.median(np.abs(far - near))), 1e-6)
    return Parallax(one_percent_mm / moved_px, one_percent_mm / LEAST_PX)
