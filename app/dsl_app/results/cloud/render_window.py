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

from dsl_app.results.cloud.points import Points, PointsActor

#: VTK cannot draw the axes in less than this, px.
SMALLEST_PX = 64
#: A step rotates the view by this, degrees, or moves it closer by this factor.
TURN_DEG, CLOSER = 6.0, 1.15

Colours = NDArray[np.uint8]
MouseButton = Literal["Left", "Middle", "Right"]
#: A mouse position, px from the upper left corner.
Place = tuple[int, int]


@dataclass(frozen=True)
class Rendering:
    """RGBX bytes (rows, columns, 4), and the 4 x 4 matrix from points to normalised coordinates."""

    pixels: NDArray[np.uint8]
    projection: NDArray[np.float64]


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
        self.cloud = PointsActor(self._plotter)
        self._is_untouched = True

    def close(self) -> None:
        """Release the graphics, which belong to this thread."""
        self._plotter.close()
        del self._plotter, self._mouse, self.cloud

    # What is shown ---------------------------------------------------------------------------------

    def show(self, points: Points, colours: Colours, reset_view: bool = True) -> None:
        """Show a cloud; points other than before reset the view, or keep it."""
        if not self.cloud.show(points, colours):
            return
        if reset_view:
            self.reset()
        else:
            self._plotter.reset_camera_clipping_range()

    def set_background(self, colour: str) -> None:
        """Set the colour behind the cloud."""
        self._plotter.set_background(colour)

    def resize(self, width: int, height: int) -> None:
        """Set the size of pictures, px; a view that was never moved is fitted to it."""
        self._size = max(width, SMALLEST_PX), max(height, SMALLEST_PX)
        self._plotter.window_size = list(self._size)
        self.cloud.resize(*self._size)
        if self._is_untouched:
            self.reset()

    def draw(self) -> Rendering:
        """Draw a picture."""
        from pyvista import convert_array
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        window, (width, height) = self._plotter.render_window, self._size
        window.Render()
        read = vtkUnsignedCharArray()
        window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, read)
        # OpenGL counts rows upwards.
        pixels = np.ascontiguousarray(convert_array(read).reshape(height, width, 4)[::-1])
        return Rendering(pixels, self.cloud.projection())

    # Look ------------------------------------------------------------------------------------------

    def reset(self) -> None:
        """Look from the position of the camera."""
        self._is_untouched = True
        self.cloud.reset()

    def press(self, button: MouseButton, at: Place, shift: bool, control: bool) -> None:
        """Press a mouse button."""
        self._point(at, shift, control)
        getattr(self._mouse, f"{button}ButtonPressEvent")()
        self._is_untouched = False

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
        self._plotter.camera.Dolly(CLOSER**steps)
        self._stepped()

    def _stepped(self) -> None:
        self._plotter.reset_camera_clipping_range()
        self._is_untouched = False
