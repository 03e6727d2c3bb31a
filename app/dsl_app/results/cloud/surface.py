"""The surface between the points of a cloud in a pyvista plotter: coarse while it moves, finer at rest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.cloud.look import Grid, Points

#: Pixels of the grid that are used while the view rotates.
COARSE = 16_000
#: A picture at rest may take this long, s; finer steps than this ratio of pixels are not worth a new mesh.
SLOW_S, LEAST_STEP = 0.3, 1.5
#: They add up to one, so that plain colours are true without a lamp.
AMBIENT, DIFFUSE, SPECULAR = 0.3, 0.7, 0.04


class SurfaceActor:
    """Shows a mesh of the grid; `grow` replaces it by finer ones, as long as pictures stay quick."""

    def __init__(self, plotter: Any) -> None:
        self._plotter = plotter
        self._points: Points | None = None
        self._grid: Grid | None = None
        self._colours: NDArray[np.uint8] = np.empty((0, 3), np.uint8)
        #: Actors, meshes and vertices of the coarse surface and, once it has grown, of the finer one.
        self._levels: list[tuple[Any, Any, NDArray[np.intp]]] = []
        self._every = 1
        self._is_coarse, self._is_lit, self._is_on = False, True, True
        #: Whether it was tried, and no points were neighbours: a single row, a pixel.
        self._is_empty = False

    @property
    def shown(self) -> int:
        """Vertices drawn at rest."""
        return len(self._levels[-1][2]) if self._levels else 0

    @property
    def can_be_drawn(self) -> bool:
        """Whether it is known which points are neighbours, and any are."""
        return self._grid is not None and not self._is_empty

    def show(self, points: Points, colours: NDArray[np.uint8], grid: Grid | None) -> None:
        """Show a cloud; without a grid there is no surface."""
        is_new = points is not self._points or grid is not self._grid
        self._points, self._grid, self._colours = points, grid, colours
        if is_new:
            self._drop(0)
            self._is_empty = False
        elif self._is_on and self._levels:
            for _, mesh, vertices in self._levels:
                mesh["colours"] = colours[vertices]
        if self._is_on and not self._levels:
            self._begin()

    def turn_on(self, on: bool) -> None:
        """Show the surface, or hide it."""
        self._is_on = on
        if on and not self._levels:
            self._begin()
        elif on:
            for _, mesh, vertices in self._levels:
                mesh["colours"] = self._colours[vertices]
        self._show_levels()

    def light(self, on: bool) -> None:
        """Shade the surface by a lamp at the eye, or show plain colours."""
        self._is_lit = on
        for actor, _, _ in self._levels:
            actor.GetProperty().SetLighting(on)

    def be_coarse(self, coarse: bool) -> None:
        """Show the coarse surface, or the finest there is."""
        self._is_coarse = coarse
        self._show_levels()

    def grow(self, frame_s: float) -> bool:
        """Make a finer surface if its picture, this one having taken ``frame_s``, is quick; False if none."""
        if not self._levels or self._every == 1 or not self._is_on:
            return False
        room = SLOW_S / max(frame_s, 1e-4)
        every = max(math.ceil(self._every / math.sqrt(max(room, 1e-9))), 1)
        if (self._every / every) ** 2 < LEAST_STEP:
            return False
        self._add(every)
        return True

    def _begin(self) -> None:
        if self._grid is not None and len(self._grid.flat) and not self._is_empty:
            rows, columns = self._grid.shape
            self._add(max(math.ceil(math.sqrt(rows * columns / COARSE)), 1))
            self._is_empty = not self._levels

    def _drop(self, first: int) -> None:
        for actor, _, _ in self._levels[first:]:
            self._plotter.remove_actor(actor, reset_camera=False, render=False)
        del self._levels[first:]

    def _add(self, every: int) -> None:
        import pyvista

        assert self._grid is not None
        assert self._points is not None
        self._drop(1)
        vertices, triangles = self._grid.mesh(self._points, every)
        self._every = every
        if len(vertices) == 0:
            return
        faces = np.empty((len(triangles), 4), np.int32)
        faces[:, 0], faces[:, 1:] = 3, triangles
        mesh = pyvista.PolyData(np.ascontiguousarray(self._points[vertices]), faces.ravel())
        mesh["colours"] = self._colours[vertices]
        normals = self._grid.normals_at(vertices)
        if normals is not None:
            mesh.point_data["Normals"] = normals
            mesh.GetPointData().SetActiveNormals("Normals")
        actor = self._plotter.add_mesh(
            mesh,
            scalars="colours",
            rgb=True,
            lighting=self._is_lit,
            ambient=AMBIENT,
            diffuse=DIFFUSE,
            specular=SPECULAR,
            reset_camera=False,
            render=False,
        )
        if normals is not None:
            actor.GetProperty().SetInterpolationToGouraud()
        self._levels.append((actor, mesh, vertices))
        self._show_levels()

    def _show_levels(self) -> None:
        shown = 0 if self._is_coarse else len(self._levels) - 1
        for place, (actor, _, _) in enumerate(self._levels):
            actor.SetVisibility(self._is_on and place == shown)
