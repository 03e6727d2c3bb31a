"""Draws a cloud by VTK in a thread of its own, so that no picture stops the window. No Qt here.

pyvista is imported here and in `cloud` alone, when a cloud is first looked at.
"""

from __future__ import annotations

import ctypes.util
import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from app.panels.cloud import Cloud, Points

#: How long after the last move of a marker the whole cloud comes back, s.
SETTLE_S = 0.25
#: In less than this VTK finds no room for the axes, px.
SMALLEST_PX = 64, 64
#: What a key turns the view by, degrees, and moves it nearer by.
TURN_DEG, NEARER = 6.0, 1.15

Colours = NDArray[np.uint8]
Act = Callable[[], object]
MouseButton = Literal["Left", "Middle", "Right"]


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


class Artist:
    """Does what it is asked to in its thread, in order, and draws when nothing more waits.

    ``drawn`` is called in that thread when there is a picture to `take` and the one before was taken.
    """

    def __init__(self, drawn: Act) -> None:
        self._drawn = drawn
        self._waiting: SimpleQueue[Act] = SimpleQueue()
        self._asked = self._done = 0
        self._lock = threading.Lock()
        self._picture: Picture | None = None
        self._is_over = False
        #: When the cloud is to be whole again, on the monotonic clock; None while it is, or is turned.
        self._rest_at: float | None = None
        self._is_held, self._is_grown, self._is_untouched = False, True, True
        #: Whether the next picture takes in new points, which tells nothing of how long later ones take.
        self._is_fresh = False
        self._picture_s, self._size = 0.0, SMALLEST_PX
        self._plotter: Any
        self._cloud: Cloud
        #: How many points of the cloud are drawn at rest.
        self.shown = 0
        self._thread = threading.Thread(target=self._run, name="3d-view", daemon=True)
        self._thread.start()

    def _ask(self, act: Act) -> None:
        self._asked += 1
        self._waiting.put(act)

    # Asked for by the window -----------------------------------------------------------------------

    @property
    def is_at_rest(self) -> bool:
        """Whether all that was asked for is drawn, with as many points as this machine draws in time."""
        return self._done == self._asked and self._patience_s() is None

    def take(self) -> Picture | None:
        """The latest picture, once."""
        with self._lock:
            picture, self._picture = self._picture, None
        return picture

    def show(self, points: Points, colours: Colours) -> None:
        """Show a cloud; other points than before are looked at anew."""
        self._ask(partial(self._show, points, colours))

    def mark(self, name: str, points: Points, colours: Colours, size_px: int, moves: bool = False) -> None:
        """Mark points; the cloud is coarse for a while where the mark ``moves``."""
        self._ask(partial(self._mark, name, points, colours, size_px, moves))

    def set_background(self, colour: str) -> None:
        """The colour behind the cloud."""
        self._ask(lambda: self._plotter.set_background(colour))

    def resize(self, width: int, height: int) -> None:
        """The size of pictures, px."""
        self._ask(partial(self._resize, *np.maximum((width, height), SMALLEST_PX).tolist()))

    def press(self, button: MouseButton, at: tuple[int, int], shift: bool, control: bool) -> None:
        """A button of the mouse goes down."""
        self._ask(partial(self._press, button, at, shift, control))

    def move(self, at: tuple[int, int], shift: bool, control: bool) -> None:
        """The mouse moves."""
        self._ask(partial(self._move, at, shift, control))

    def release(self, button: MouseButton, at: tuple[int, int]) -> None:
        """A button of the mouse goes up."""
        self._ask(partial(self._release, button, at))

    def turn(self, right: int, up: int) -> None:
        """Turn the view by so many steps."""
        self._ask(partial(self._turn, right, up))

    def zoom(self, steps: float) -> None:
        """Move nearer by so many steps, or away."""
        self._ask(partial(self._zoom, steps))

    def reset(self) -> None:
        """Look from where the camera stood."""
        self._ask(self._reset)

    def close(self) -> None:
        """End after the picture at hand, and wait for that."""
        self._ask(self._end)
        self._thread.join()

    # In the thread ---------------------------------------------------------------------------------

    def _run(self) -> None:
        self._begin()
        while not self._is_over:
            acts = self._wait()
            for act in acts:
                act()
            if not acts:
                self._go_on()
            if not self._is_over:
                self._draw()
            self._done += len(acts)

    def _begin(self) -> None:
        import pyvista
        from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera

        self._plotter = pyvista.Plotter(off_screen=True, window_size=list(self._size))
        self._plotter.suppress_rendering = True
        self._plotter.render_window.SetMultiSamples(0)
        self._mouse = self._plotter.iren.interactor
        self._mouse.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
        # The style moves the camera; pictures are made when nothing more waits.
        self._mouse.EnableRenderOff()
        self._cloud = Cloud(self._plotter)
        self._plotter.add_axes(interactive=False, color="#808080")

    def _end(self) -> None:
        self._is_over = True
        self._plotter.close()
        # Graphics are let go in the thread that they belong to.
        del self._plotter, self._cloud, self._mouse

    def _wait(self) -> list[Act]:
        """All that waits; nothing where it is time to add to the cloud unasked."""
        acts = []
        try:
            acts.append(self._waiting.get(timeout=self._patience_s()))
            while True:
                acts.append(self._waiting.get_nowait())
        except Empty:
            return acts

    def _patience_s(self) -> float | None:
        if self._rest_at is not None:
            return max(self._rest_at - time.monotonic(), 0.0)
        return None if self._is_grown or self._is_held else 0.0

    def _go_on(self) -> None:
        if self._rest_at is not None:
            self._rest()
        elif self._is_fresh:
            self._is_fresh = False
        else:
            self._is_fresh = self._cloud.grow(self._picture_s)
            self._is_grown = not self._is_fresh

    def _draw(self) -> None:
        begun = time.perf_counter()
        self._plotter.render_window.Render()
        self._picture_s, self.shown = time.perf_counter() - begun, self._cloud.shown
        picture = Picture(self._pixels(), self._cloud.projection())
        with self._lock:
            is_taken, self._picture = self._picture is None, picture
        if is_taken:
            # Who looked at it may be gone by now.
            with suppress(RuntimeError):
                self._drawn()

    def _pixels(self) -> NDArray[np.uint8]:
        from pyvista import convert_array
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        width, height = self._size
        read = vtkUnsignedCharArray()
        self._plotter.render_window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, read)
        # Rows of OpenGL count upwards.
        return np.ascontiguousarray(convert_array(read).reshape(height, width, 4)[::-1])

    def _show(self, points: Points, colours: Colours) -> None:
        if self._cloud.show(points, colours):
            self._reset()
        self._is_fresh, self._is_grown = True, False

    def _mark(self, name: str, points: Points, colours: Colours, size_px: int, moves: bool) -> None:
        self._cloud.mark(name, points, colours, size_px)
        if moves:
            self._cloud.be_coarse(True)
            # A marker that was moved just before must not slow down who turns the view.
            self._rest_at = None if self._is_held else time.monotonic() + SETTLE_S

    def _rest(self) -> None:
        self._rest_at = None
        self._cloud.be_coarse(False)

    def _resize(self, width: int, height: int) -> None:
        self._size = width, height
        self._plotter.window_size = [width, height]
        self._cloud.resize(width, height)
        # Until a person turns the view, it fits the cloud into whatever size the layout settles on.
        if self._is_untouched:
            self._reset()

    def _reset(self) -> None:
        self._is_untouched = True
        self._cloud.reset()

    def _at(self, at: tuple[int, int], shift: bool = False, control: bool = False) -> None:
        self._mouse.SetEventInformationFlipY(*at, control, shift, chr(0), 0, None)

    def _press(self, button: str, at: tuple[int, int], shift: bool, control: bool) -> None:
        self._at(at, shift, control)
        getattr(self._mouse, f"{button}ButtonPressEvent")()
        self._is_held, self._is_untouched, self._rest_at = True, False, None
        self._cloud.be_coarse(True)

    def _move(self, at: tuple[int, int], shift: bool, control: bool) -> None:
        self._at(at, shift, control)
        self._mouse.MouseMoveEvent()

    def _release(self, button: str, at: tuple[int, int]) -> None:
        self._at(at)
        getattr(self._mouse, f"{button}ButtonReleaseEvent")()
        self._is_held = False
        self._rest()

    def _turn(self, right: int, up: int) -> None:
        camera = self._plotter.camera
        camera.Azimuth(-TURN_DEG * right)
        camera.Elevation(-TURN_DEG * up)
        camera.OrthogonalizeViewUp()
        self._touched()

    def _zoom(self, steps: float) -> None:
        self._plotter.camera.Dolly(NEARER**steps)
        self._touched()

    def _touched(self) -> None:
        """The view was moved by a step: show a part of the cloud until no further one follows."""
        self._plotter.reset_camera_clipping_range()
        self._is_untouched = False
        self._cloud.be_coarse(True)
        self._rest_at = None if self._is_held else time.monotonic() + SETTLE_S
