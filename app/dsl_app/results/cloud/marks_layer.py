"""Marks in front of a cloud: a layer of their own, that neither hides nor is shaded."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.cloud.look import Points


class MarksLayer:
    """Points of fixed size on the screen, by name, drawn after all else and by the same camera."""

    def __init__(self, plotter: Any) -> None:
        from vtkmodules.vtkRenderingCore import vtkRenderer

        self._renderer = vtkRenderer()
        self._renderer.SetLayer(1)
        self._renderer.SetActiveCamera(plotter.renderer.GetActiveCamera())
        self._renderer.InteractiveOff()
        plotter.render_window.SetNumberOfLayers(2)
        plotter.render_window.AddRenderer(self._renderer)
        self._actors: dict[str, tuple[Any, Any]] = {}

    def show(self, name: str, points: Points, colours: NDArray[np.uint8], size_px: int) -> None:
        """Show points (n, 3) with colours (n, 3) in place of those of the same name."""
        import pyvista

        actor, _ = self._actors.pop(name, (None, None))
        if actor is not None:
            self._renderer.RemoveActor(actor)
        if len(points) == 0:
            return
        mesh = pyvista.PolyData(np.ascontiguousarray(points))
        mesh["colours"] = colours
        mapper = pyvista.DataSetMapper(mesh)
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray("colours")
        mapper.SetColorModeToDirectScalars()
        mapper.ScalarVisibilityOn()
        actor = pyvista.Actor(mapper=mapper)
        actor.GetProperty().SetRepresentationToPoints()
        actor.GetProperty().SetPointSize(size_px)
        actor.GetProperty().SetLighting(False)
        self._renderer.AddActor(actor)
        self._actors[name] = actor, mesh
