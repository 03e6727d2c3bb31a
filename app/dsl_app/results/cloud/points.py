"""A point cloud in a pyvista plotter: a part of it while it moves, as much as is quick at rest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.cloud.look import Grid, Points

#: Points drawn while the view rotates.
COARSE = 60_000
#: Sizes of points, px, and how much they overlap, so that no hole shows between neighbours.
LEAST_PX, LARGEST_PX, OVERLAP = 2.0, 60.0, 1.35
#: A picture at rest may take this long, s, as rotating has to wait for it. Steps that add less than this
#: share of the points are not worth it.
SLOW_S, LEAST_STEP = 0.1, 0.25


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
        self._is_on, self._scale = True, 1.0
        #: Typical distance of neighbours, mm.
        self.spacing_mm = 1.0

    def show(self, points: Points, colours: NDArray[np.uint8], grid: Grid | None = None) -> bool:
        """Show a cloud; True when the points are new, and not only their colours.

        With the ``grid`` that they come from, a part of them leaves no holes.
        """
        self._colours = colours
        if points is self._points and self._parts:
            # Uploading colours is as slow as points, so the rest grows again.
            first, *others = self._parts
            self._drop(others)
            if self.shown:  # else its one point is none of the cloud
                self._meshes[first]["colours"] = colours[self._parts[first]]
            self.be_coarse(self.is_coarse)
            return False
        self._drop(list(self._parts))
        self._points = points
        # A fixed order, so that a part of the cloud is evenly spread and does not flicker.
        if grid is not None:
            self._order = grid.even_order()
        else:
            self._order = np.random.default_rng(0).permutation(len(points)).astype(np.int32)
        self.spacing_mm = spacing(points)
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
        self._put(name, self._points[index], self._colours[index], LEAST_PX)
        self.be_coarse(self.is_coarse)

    def _put(self, name: str, points: Points, colours: NDArray[np.uint8], size_px: float) -> None:
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

    def resize(self, width: int, height: int) -> None:
        """Set the size of the view, px."""
        self._size = width, height

    def turn_on(self, on: bool, scale: float) -> None:
        """Show the points, ``scale`` times as large as fills the room between them, or hide them."""
        self._is_on, self._scale = on, scale
        self.be_coarse(self.is_coarse)

    def be_coarse(self, coarse: bool) -> None:
        """Show only the first part, or all."""
        self.is_coarse = coarse
        for number, name in enumerate(self._parts):
            self._actors[name].SetVisibility(self._is_on and (number == 0 or not coarse))

    def fit_size(self, mm_per_px: float) -> None:
        """Give points the size that fills the room between them: the nearer and the fewer, the larger."""
        drawn = min(COARSE, self.shown) if self.is_coarse else self.shown
        apart_mm = self.spacing_mm * math.sqrt(len(self._order) / max(drawn, 1))
        size_px = point_size(apart_mm, mm_per_px, self._scale)
        for name in self._parts:
            self._actors[name].GetProperty().SetPointSize(size_px)

    def extent(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Lowest and highest x, y, z of nearly all points, mm; None without points."""
        if self._points is None or len(self._order) == 0:
            return None
        low, high = np.percentile(self._points[self._order[:COARSE]], (0.5, 99.5), axis=0)
        return low, high

    def projection(self) -> NDArray[np.float64]:
        """From points to normalised screen coordinates, 4 x 4."""
        width, height = self._size
        matrix = self.plotter.camera.GetCompositeProjectionTransformMatrix(width / max(height, 1), -1, 1)
        return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def point_size(apart_mm: float, mm_per_px: float, scale: float = 1.0) -> float:
    """Size of points that are so far apart in a view of so many mm a pixel, px.

    >>> point_size(0.5, 0.25), point_size(0.5, 0.025), point_size(0.5, 5.0), point_size(0.5, 0.001)
    (2.7, 27.0, 2.0, 60.0)
    """
    if not mm_per_px > 0:
        return LEAST_PX
    return min(max(scale * OVERLAP * apart_mm / mm_per_px, LEAST_PX * min(scale, 1.0)), LARGEST_PX)


def spacing(points: Points) -> float:
    """Typical distance of neighbours among points (n, 3), mm.

    Pixels of a row follow each other. Where points are in no order, the area that they cover says more.
    """
    if len(points) < 2:
        return 1.0
    step = max(len(points) // COARSE, 1)
    apart = np.linalg.norm(points[1::step] - points[:-1:step][: len(points[1::step])], axis=1)
    wide, tall, _ = np.ptp(points[::step], axis=0)
    beside = float(np.median(apart))
    # A single row or column covers no area.
    covered = math.sqrt(wide * tall / len(points)) or beside
    return max(min(beside, covered), 1e-6)
