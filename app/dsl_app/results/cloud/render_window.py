"""VTK's off-screen render window with its camera and mouse, for the one thread that made it.

Only this module and `points` import pyvista, when a cloud is first shown.
"""

from __future__ import annotations

import ctypes.util
import os
import sys
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.cloud.look import DIRECTIONS, Grid, Look, Points, Side
from dsl_app.results.cloud.marks_layer import MarksLayer
from dsl_app.results.cloud.points import PointsActor
from dsl_app.results.cloud.surface import SurfaceActor
from dsl_core.evaluation.screen import mm_per_px

#: VTK cannot draw the axes in less than this, px.
SMALLEST_PX = 64
#: A step rotates the view by this, degrees, or moves it closer by this factor.
TURN_DEG, CLOSER = 6.0, 1.15
#: Angle of view of standard views, degrees.
SIDE_ANGLE_DEG = 25.0

Colours = NDArray[np.uint8]
MouseButton = Literal["Left", "Middle", "Right"]
#: A mouse position, px from the upper left corner.
Place = tuple[int, int]


@dataclass(frozen=True)
class Rendering:
    """RGBX bytes (rows, columns, 4), and the 4 x 4 matrix from points to normalised coordinates.

    ``focus_mm`` (3,) is what the view turns about; ``box_mm`` the corners of lowest and highest coordinates
    of a box that is shown.
    """

    pixels: NDArray[np.uint8]
    projection: NDArray[np.float64]
    focus_mm: NDArray[np.float64]
    box_mm: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None


def graphics_work() -> bool:
    """Whether VTK can draw on this computer; takes a while, in any thread."""
    if sys.platform == "linux":
        # EGL needs no display server, whose library is not thread-safe.
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    # Failed attempts need not be on the console.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    # VTK tries its back ends in turn, but picks the last one without testing it.
    name: str = vtkRenderWindow().GetClassName()
    return name != "vtkOSOpenGLRenderWindow" or ctypes.util.find_library("OSMesa") is not None


class RenderWindow:
    """Holds a cloud, its marks, and a camera moved by mouse events or steps."""

    def __init__(self) -> None:
        import pyvista
        from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera

        self._size = SMALLEST_PX, SMALLEST_PX
        make: Any = pyvista.Plotter
        self._plotter = make(off_screen=True, window_size=list(self._size))
        self._plotter.suppress_rendering = True
        self._plotter.render_window.SetMultiSamples(0)
        self._mouse = self._plotter.iren.interactor
        self._mouse.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
        # The style moves the camera; pictures are drawn on request.
        self._mouse.EnableRenderOff()
        self._plotter.add_axes(interactive=False, color="#808080")
        self.cloud, self.surface = PointsActor(self._plotter), SurfaceActor(self._plotter)
        self.marks = MarksLayer(self._plotter)
        self.look = Look()
        self._box: Any = None
        self._side: Side | None = Side.CAMERA

    def close(self) -> None:
        """Release the graphics, which belong to this thread."""
        self._plotter.close()
        del self._plotter, self._mouse, self.cloud, self.surface, self.marks

    # What is shown ---------------------------------------------------------------------------------

    def show(
        self, points: Points, colours: Colours, reset_view: bool = True, grid: Grid | None = None
    ) -> None:
        """Show a cloud; points other than before reset the view, or keep it."""
        is_new = self.cloud.show(points, colours, grid)
        self.surface.show(points, colours, grid)
        self._choose()
        if not is_new:
            return
        self._show_box()
        if reset_view:
            self.reset()
        else:
            self._plotter.reset_camera_clipping_range()

    def take_look(self, look: Look) -> None:
        """Draw something else."""
        before, self.look = self.look, look
        self._choose()
        self.surface.light(look.light)
        if look.depth_shade is not before.depth_shade:
            if look.depth_shade:
                self._plotter.enable_eye_dome_lighting()
            else:
                self._plotter.disable_eye_dome_lighting()
        if look.parallel is not before.parallel:
            self._be_parallel(look.parallel)
        self._show_box()

    def _choose(self) -> None:
        # Only then it is known whether there is one.
        self.surface.turn_on(self.look.surface)
        self.cloud.turn_on(not self.shows_surface, self.look.size)

    @property
    def shows_surface(self) -> bool:
        """Whether the surface is drawn, and not the points."""
        return self.look.surface and self.surface.can_be_drawn

    @property
    def shown(self) -> int:
        """Points drawn at rest."""
        return self.surface.shown if self.shows_surface else self.cloud.shown

    def be_coarse(self, coarse: bool) -> None:
        """Draw less, or all."""
        self.cloud.be_coarse(coarse)
        self.surface.be_coarse(coarse)

    def grow(self, frame_s: float) -> bool:
        """Draw more if pictures, the last having taken ``frame_s``, stay quick; False if there is no more."""
        return self.surface.grow(frame_s) if self.shows_surface else self.cloud.grow(frame_s)

    def _show_box(self) -> None:
        if self._box is not None:
            self._plotter.remove_actor(self._box, reset_camera=False, render=False)
            self._box = None
        extent = self.cloud.extent()
        if not self.look.box or extent is None:
            return
        import pyvista

        low, high = extent
        box: Any = pyvista.Box(bounds=[limit for pair in zip(low, high, strict=True) for limit in pair])
        self._box = self._plotter.add_mesh(
            box.extract_all_edges(), color="#808080", lighting=False, reset_camera=False, render=False
        )

    def set_background(self, colour: str) -> None:
        """Set the colour behind the cloud."""
        self._plotter.set_background(colour)

    def resize(self, width: int, height: int) -> None:
        """Set the size of pictures, px; a view that was never moved is fitted to it."""
        self._size = max(width, SMALLEST_PX), max(height, SMALLEST_PX)
        self._plotter.window_size = list(self._size)
        self.cloud.resize(*self._size)
        if self._side is not None:
            self.see_from(self._side)

    def draw(self) -> Rendering:
        """Draw a picture."""
        from pyvista import convert_array
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        window, (width, height) = self._plotter.render_window, self._size
        focus, projection = np.array(self._plotter.camera.focal_point), self.cloud.projection()
        self.cloud.fit_size(mm_per_px(focus, projection, height))
        window.Render()
        read = vtkUnsignedCharArray()
        window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, read)
        # OpenGL counts rows upwards.
        pixels = np.ascontiguousarray(convert_array(read).reshape(height, width, 4)[::-1])
        box = self.cloud.extent() if self.look.box else None
        return Rendering(pixels, self.cloud.projection(), focus, box)

    # Look ------------------------------------------------------------------------------------------

    def reset(self) -> None:
        """Look from the position of the camera."""
        self.see_from(Side.CAMERA)

    def see_from(self, side: Side) -> None:
        """Look at the whole cloud from a side, or from where the camera stood."""
        self._side = side
        extent = self.cloud.extent()
        if extent is None:
            return
        low, high = extent
        centre, span = (low + high) / 2, (high - low) / 2
        width, height = self._size
        forward, up = (np.array(each, np.float64) for each in DIRECTIONS[side])
        wide, tall, deep = (float(np.abs(each) @ span) for each in (np.cross(forward, up), up, forward))
        reach = 1.1 * max(tall, wide * height / max(width, 1), 1e-3)
        camera = self._plotter.camera
        if side is Side.CAMERA:
            camera.position, camera.view_angle = (0.0, 0.0, 0.0), _angle_deg(reach, low[2])
        else:
            away = reach / np.tan(np.radians(SIDE_ANGLE_DEG / 2)) + deep
            camera.position, camera.view_angle = tuple(centre - away * forward), SIDE_ANGLE_DEG
        camera.up, camera.focal_point = tuple(up), tuple(centre)
        camera.parallel_scale = reach
        self._plotter.reset_camera_clipping_range()

    def _be_parallel(self, parallel: bool) -> None:
        """Change the projection, with what the view turns about as large as before."""
        camera = self._plotter.camera
        half = np.tan(np.radians(camera.view_angle / 2))
        if parallel:
            camera.parallel_scale = camera.distance * half
        else:
            away = camera.parallel_scale / half / camera.distance
            camera.Dolly(1 / max(away, 1e-6))
        camera.parallel_projection = parallel
        self._plotter.reset_camera_clipping_range()

    def press(self, button: MouseButton, at: Place, shift: bool, control: bool) -> None:
        """Press a mouse button."""
        self._point(at, shift, control)
        getattr(self._mouse, f"{button}ButtonPressEvent")()
        self._side = None

    def move(self, at: Place, shift: bool, control: bool) -> None:
        """Move the mouse."""
        self._point(at, shift, control)
        self._mouse.MouseMoveEvent()

    def release(self, button: MouseButton, at: Place) -> None:
        """Release a mouse button."""
        self._point(at)
        getattr(self._mouse, f"{button}ButtonReleaseEvent")()

    def _point(self, at: Place, shift: bool = False, control: bool = False) -> None:
        self._mouse.SetEventInformationFlipY(*at, control, shift, chr(0), 0, None)

    def turn(self, right: int, up: int) -> None:
        """Rotate the view by steps."""
        camera = self._plotter.camera
        camera.Azimuth(-TURN_DEG * right)
        camera.Elevation(-TURN_DEG * up)
        camera.OrthogonalizeViewUp()
        self._stepped()

    def zoom(self, steps: float) -> None:
        """Move the camera closer by steps, or away."""
        camera = self._plotter.camera
        if self.look.parallel:
            camera.parallel_scale /= CLOSER**steps
        else:
            camera.Dolly(CLOSER**steps)
        self._stepped()

    def _stepped(self) -> None:
        self._plotter.reset_camera_clipping_range()
        self._side = None


def _angle_deg(reach: float, away: float) -> float:
    """The angle that shows ``reach`` to either side at a distance, degrees; at most what VTK can draw."""
    return float(min(np.degrees(2 * np.arctan2(reach, max(away, 1e-6))), 150.0))
