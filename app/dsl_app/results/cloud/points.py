"""A point cloud in a pyvista plotter: a part of it while it moves, as much as is quick at rest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]
#: Points drawn while the view rotates.
COARSE = 60_000
#: A picture at rest may take this long, s, as rotating has to wait for it. Steps that add less than this
#: share of the points are not worth it.
SLOW_S, LEAST_STEP = 0.1, 0.25
POINT_PX, COARSE_PX, LARGEST_PX = 2, 3, 10
#: Depth buffer offset that draws marks in front of any cloud.
TO_THE_FRONT = -66_000
#: About the share of the view that a cloud covers; few points are drawn larger, so that it looks solid.
COVERED = 0.6


class PointsActor:
    """Shows some points at once; `grow` adds more, step by step, as long as that is quick."""

    def __init__(self, plotter: Any) -> None:
        self.plotter = plotter
        self.shown = 0
        self._actors: dict[str, Any] = {}
        self._meshes: dict[str, Any] = {}
        self._points: Points | None = None
        self._colours: NDArray[np.uint8] = np.empty((0, 3), np.uint8)
        self._parts: dict[str, NDArray[np.int32]] = {}
        self._order = np.empty(0, np.int32)
        self.is_coarse = False
        self._size = 640, 480

    def show(self, points: Points, colours: NDArray[np.uint8]) -> bool:
        """Show a cloud; True when the points are new, and not only their colours."""
        self._colours = colours
        if points is self._points and self._parts:
            # Uploading colours is as slow as points, so the rest grows again.
            first, *others = self._parts
            self._drop(others)
            self._meshes[first]["colours"] = colours[self._parts[first]]
            self.be_coarse(self.is_coarse)
            return False
        self._drop(list(self._parts))
        self._points = points
        # A fixed random order, so that a part of the cloud is evenly spread and does not flicker.
        self._order = np.random.default_rng(0).permutation(len(points)).astype(np.int32)
        self._add(COARSE)
        return True

    def _drop(self, names: list[str]) -> None:
        for name in names:
            self.plotter.remove_actor(self._actors.pop(name), reset_camera=False, render=False)
            del self._meshes[name], self._parts[name]
        self.shown = sum(map(len, self._parts.values()))

    def grow(self, frame_s: float) -> bool:
        """Add points if pictures stay quick, the last having taken ``frame_s``; False if none were added."""
        left = len(self._order) - self.shown
        room = int(self.shown * min(SLOW_S / max(frame_s, 1e-4) - 1, 1.0))
        if left == 0 or room < min(left, LEAST_STEP * self.shown):
            return False
        self._add(min(room, left))
        return True

    def _add(self, count: int) -> None:
        assert self._points is not None
        name, index = f"part {len(self._parts)}", self._order[self.shown : self.shown + count]
        self._parts[name] = index
        self.shown += len(index)
        self._put(name, self._points[index], self._colours[index], POINT_PX)
        self.be_coarse(self.is_coarse)

    def _put(self, name: str, points: Points, colours: NDArray[np.uint8], size_px: int) -> None:
        import pyvista

        if name in self._actors:
            self.plotter.remove_actor(self._actors.pop(name), reset_camera=False, render=False)
        if len(points) == 0:
            # VTK needs at least one point; this one is never visible.
            points, colours = np.full((1, 3), -1e6, np.float32), np.zeros((1, 3), np.uint8)
        mesh = pyvista.PolyData(np.ascontiguousarray(points))
        mesh["colours"] = colours
        self._meshes[name] = mesh
        self._actors[name] = self.plotter.add_mesh(
            mesh,
            scalars="colours",
            rgb=True,
            style="points",
            point_size=size_px,
            lighting=False,
            reset_camera=False,
            render=False,
        )

    def mark(self, name: str, points: Points, colours: NDArray[np.uint8], size_px: int) -> None:
        """Show points in front of all others, so that marks are always visible."""
        old = self._meshes.get(name)
        if old is not None and len(points) and old.n_points == len(points):
            old.points = np.ascontiguousarray(points)
            old["colours"] = colours
        else:
            self._put(name, points, colours, size_px)
            mapper = self._actors[name].GetMapper()
            mapper.SetResolveCoincidentTopologyToPolygonOffset()
            mapper.SetRelativeCoincidentTopologyPointOffsetParameter(TO_THE_FRONT)

    def resize(self, width: int, height: int) -> None:
        """Adapt the point size to a view of this size, px."""
        self._size = width, height
        self.be_coarse(self.is_coarse)

    def be_coarse(self, coarse: bool) -> None:
        """Show only the first part, or all; the fewer points, the larger they are."""
        self.is_coarse = coarse
        width, height = self._size
        size_px = point_size(min(COARSE, self.shown) if coarse else self.shown, width * height)
        for number, name in enumerate(self._parts):
            actor = self._actors[name]
            actor.SetVisibility(number == 0 or not coarse)
            actor.GetProperty().SetPointSize(min(size_px, COARSE_PX) if self.shown > COARSE else size_px)

    def reset(self) -> None:
        """Look along the axis of the camera, so that the whole cloud fits into the view."""
        if self._points is None or len(self._order) == 0:
            return
        low, high = np.percentile(self._points[self._order[:COARSE]], (0.5, 99.5), axis=0)
        width, height = self._size
        centre, span = (low + high) / 2, (high - low) / 2
        camera = self.plotter.camera
        camera.position, camera.up, camera.focal_point = (0.0, 0.0, 0.0), (0.0, -1.0, 0.0), tuple(centre)
        reach = 1.1 * max(span[1], span[0] * height / max(width, 1))
        camera.view_angle = float(np.degrees(2 * np.arctan2(reach, low[2])))
        self.plotter.reset_camera_clipping_range()

    def projection(self) -> NDArray[np.float64]:
        """From points to normalised screen coordinates, 4 x 4."""
        width, height = self._size
        matrix = self.plotter.camera.GetCompositeProjectionTransformMatrix(width / max(height, 1), -1, 1)
        return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def point_size(count: int, view_px: int) -> int:
    """Size of ``count`` points in a view of ``view_px`` pixels, px.

    >>> point_size(500_000, 300_000), point_size(14_000, 300_000), point_size(100, 300_000)
    (2, 4, 10)
    """
    return min(max(round(math.sqrt(COVERED * view_px / max(count, 1))), POINT_PX), LARGEST_PX)
