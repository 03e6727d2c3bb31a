"""What a cloud is drawn with: VTK's camera, mouse and pictures, for the one thread that made it.

pyvista is imported here and in `cloud` alone, when a cloud is first looked at.
"""

from __future__ import annotations

import ctypes.util
import os
import sys
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.cloud.points import Cloud, Points

#: In less than this VTK finds no room for the axes, px.
SMALLEST_PX = 64
#: What a step turns the view by, degrees, and moves it nearer by.
TURN_DEG, NEARER = 6.0, 1.15

Colours = NDArray[np.uint8]
MouseButton = Literal["Left", "Middle", "Right"]
#: A place of the mouse (px, from the upper left corner).
Place = tuple[int, int]


@dataclass(frozen=True)
class Picture:
    """What is to be seen: RGBX bytes (rows, columns, 4), and the 4 x 4 matrix from points to its sides."""

    pixels: NDArray[np.uint8]
    projection: NDArray[np.float64]


def graphics_work() -> bool:
    """Whether VTK finds something to draw with here; it takes a while, and any thread may ask."""
    if sys.platform == "linux":
        # Without a display server in between, whose library dislikes threads.
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    # What it tries in vain is no news for the console.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    # VTK tries what it knows one after the other, but takes the last one unseen.
    name: str = vtkRenderWindow().GetClassName()
    return name != "vtkOSOpenGLRenderWindow" or ctypes.util.find_library("OSMesa") is not None


class Easel:
    """Holds a cloud, marks on it, and the view of them, which a mouse or steps can turn."""

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
        # The style moves the camera; pictures are made when they are asked for.
        self._mouse.EnableRenderOff()
        self._plotter.add_axes(interactive=False, color="#808080")
        self.cloud = Cloud(self._plotter)
        self._is_untouched = True

    def close(self) -> None:
        """Let the graphics go, which belong to this thread."""
        self._plotter.close()
        del self._plotter, self._mouse, self.cloud

    # What is shown ---------------------------------------------------------------------------------

    def show(self, points: Points, colours: Colours, anew: bool = True) -> None:
        """Show a cloud; other points than before are looked at ``anew``, or from where one is."""
        if not self.cloud.show(points, colours):
            return
        if anew:
            self.reset()
        else:
            self._plotter.reset_camera_clipping_range()

    def set_background(self, colour: str) -> None:
        """The colour behind the cloud."""
        self._plotter.set_background(colour)

    def resize(self, width: int, height: int) -> None:
        """Draw pictures of another size, px; until somebody turns it, the view fits the cloud into it."""
        self._size = max(width, SMALLEST_PX), max(height, SMALLEST_PX)
        self._plotter.window_size = list(self._size)
        self.cloud.resize(*self._size)
        if self._is_untouched:
            self.reset()

    def draw(self) -> Picture:
        """Draw a picture."""
        from pyvista import convert_array
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        window, (width, height) = self._plotter.render_window, self._size
        window.Render()
        read = vtkUnsignedCharArray()
        window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, read)
        # Rows of OpenGL count upwards.
        pixels = np.ascontiguousarray(convert_array(read).reshape(height, width, 4)[::-1])
        return Picture(pixels, self.cloud.projection())

    # Look ------------------------------------------------------------------------------------------

    def reset(self) -> None:
        """Look from where the camera stood."""
        self._is_untouched = True
        self.cloud.reset()

    def press(self, button: MouseButton, at: Place, shift: bool, control: bool) -> None:
        """A button of the mouse goes down."""
        self._point(at, shift, control)
        getattr(self._mouse, f"{button}ButtonPressEvent")()
        self._is_untouched = False

    def move(self, at: Place, shift: bool, control: bool) -> None:
        """The mouse moves."""
        self._point(at, shift, control)
        self._mouse.MouseMoveEvent()

    def release(self, button: MouseButton, at: Place) -> None:
        """A button of the mouse goes up."""
        self._point(at)
        getattr(self._mouse, f"{button}ButtonReleaseEvent")()

    def _point(self, at: Place, shift: bool = False, control: bool = False) -> None:
        self._mouse.SetEventInformationFlipY(*at, control, shift, chr(0), 0, None)

    def turn(self, right: int, up: int) -> None:
        """Turn the view by so many steps."""
        camera = self._plotter.camera
        camera.Azimuth(-TURN_DEG * right)
        camera.Elevation(-TURN_DEG * up)
        camera.OrthogonalizeViewUp()
        self._stepped()

    def zoom(self, steps: float) -> None:
        """Move nearer by so many steps, or away."""
        self._plotter.camera.Dolly(NEARER**steps)
        self._stepped()

    def _stepped(self) -> None:
        self._plotter.reset_camera_clipping_range()
        self._is_untouched = False
