"""Where the camera should see a target, and whether what it sees is there and keeps still. No Qt."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dsl_app.calibrate.wizard.placement_scene import Face
from dsl_core.model.geometry import Lens
from dsl_core.model.placement import Placement
from dsl_core.optics.pinhole import project

#: Points of the camera's picture, column and row, px.
PointsPx = tuple[tuple[float, float], ...]
#: A target is where it is wanted if both outlines share at least this part of what they cover together: a
#: board that faces the camera in place of one tilted by 35 degrees shares 0.8.
LEAST_SHARED = 0.8
#: A target keeps still if no point moved farther than this between two looks, px.
STILL_PX = 1.0


def ghost(placement: Placement, camera: Lens) -> PointsPx:
    """Outline of what a look finds of the target where it is wanted; empty for targets without points.

    ``camera`` may be nominal: the outline tells a person where to hold the target and is not a measurement.
    """
    face = Face.of(placement)
    if face is None or face.found_half_mm is None:
        return ()
    half_x, half_y = face.found_half_mm
    ways = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = np.array([face.at(x * half_x, y * half_y) for x, y in ways])
    return as_points(np.stack(project(camera, *corners.T), axis=-1))


def as_points(points_px: np.ndarray) -> PointsPx:
    """Points of an array of shape (points, 2)."""
    return tuple((float(x), float(y)) for x, y in points_px)


def shared_part(wanted: PointsPx, found: PointsPx) -> float:
    """What the outlines of two sets of points share of what they cover together, 0 to 1; 0 without points.

    >>> round(shared_part(((0, 0), (2, 0), (2, 2), (0, 2)), ((1, 0), (3, 0), (3, 2), (1, 2))), 3)
    0.333
    """
    import cv2

    if min(len(wanted), len(found)) < 3:
        return 0.0
    one, other = (cv2.convexHull(np.array(points, np.float32)) for points in (wanted, found))
    both, _ = cv2.intersectConvexConvex(one, other)
    together = cv2.contourArea(one) + cv2.contourArea(other) - both
    return float(both / together) if together > 0 else 0.0


def keeps_still(before: Sequence[tuple[float, float]], now: Sequence[tuple[float, float]]) -> bool:
    """Whether two looks found the same points at the same places, counted from either end of a board."""
    if not now or len(before) != len(now):
        return False
    ways = (np.asarray(now), np.asarray(now)[::-1])
    moved_px = (np.linalg.norm(way - np.asarray(before), axis=1).max() for way in ways)
    return float(min(moved_px)) <= STILL_PX
