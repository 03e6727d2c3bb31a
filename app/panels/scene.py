"""Points in space behind a small protocol: by VTK where there is OpenGL, else as a picture or a sentence.

pyvista and its Qt window are imported here and in `cloud` alone, when a cloud is first looked at.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QPointF, QTimer
from PySide6.QtGui import QGuiApplication, QMouseEvent, QOffscreenSurface, QOpenGLContext
from PySide6.QtWidgets import QWidget

from app.panels.cloud import Cloud, Points
from app.panels.still_scene import StillScene

#: How long after the last move the whole cloud comes back, ms.
SETTLE_MS = 250
#: How long the window may do other things between two steps in which a cloud grows, ms.
GROW_MS = 30
#: Pictures between two steps: one prepares what is new, the next one tells how long a picture takes.
PICTURES = 2


class Scene(Protocol):
    """Shows a cloud; tells where the mouse points in normalised screen coordinates."""

    widget: QWidget

    def show_cloud(self, points: Points, colours: NDArray[np.uint8]) -> None:
        """Show points (n, 3) in mm with their colours (n, 3); other points are looked at anew."""

    def show_marker(self, point: Points | None, colour: str) -> None:
        """Mark a point; None marks nothing."""

    def show_pins(self, points: Points, colours: NDArray[np.uint8]) -> None:
        """Mark some points for good."""

    def set_background(self, colour: str) -> None:
        """The colour behind the cloud."""

    def projection(self) -> NDArray[np.float64]:
        """The 4 x 4 matrix from points to normalised screen coordinates."""

    def reset(self) -> None:
        """Look from where the camera stood."""

    def close(self) -> None:
        """Let go of the graphics context."""


@cache
def gl_works() -> bool:
    """Whether Qt can draw by OpenGL here: tried, not guessed; the first time takes a while."""
    if QGuiApplication.platformName() in ("offscreen", "minimal"):
        return False
    surface, context = QOffscreenSurface(), QOpenGLContext()
    surface.create()
    works = context.create() and context.makeCurrent(surface)
    context.doneCurrent()
    return bool(works)


def prepare_scene() -> None:
    """Import what a scene needs: seconds, in which a thread does not stop the window."""
    import pyvista
    import pyvistaqt  # noqa: F401

    # What pyvista imports no sooner than when a scene is made, in the window's thread.
    import vtkmodules.vtkInteractionWidgets
    import vtkmodules.vtkViewsContext2D  # noqa: F401

    # The first points of all look for more of pyvista than those that follow.
    pyvista.PolyData(np.zeros((1, 3), np.float32))["colours"] = np.zeros((1, 3), np.uint8)


def make_scene(moved: Callable[[], object], mouse: Callable[[QMouseEvent], bool]) -> Scene:
    """The best scene that works here; ``moved`` hears of new views, ``mouse`` may take mouse events."""
    return GlScene(moved, mouse) if gl_works() else StillScene()


class _Watch(QObject):
    """Hands mouse events of a widget to a function, which may keep them, and tells of its size."""

    def __init__(
        self, take: Callable[[QMouseEvent], bool], resized: Callable[[], object], parent: QObject
    ) -> None:
        super().__init__(parent)
        self._take, self._resized = take, resized

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Offer every mouse event; tell of a new size."""
        if event.type() == QEvent.Type.Resize:
            self._resized()
        return isinstance(event, QMouseEvent) and self._take(event)


class GlScene:
    """A scene by VTK in an OpenGL widget; coarse while it turns or the marker moves."""

    def __init__(self, moved: Callable[[], object], mouse: Callable[[QMouseEvent], bool]) -> None:
        from pyvistaqt import QtInteractor

        # It renders when asked: neither every 200 ms nor with four samples a pixel.
        interactor: Any = QtInteractor
        self._plotter: Any = interactor(None, auto_update=False, multi_samples=0)
        # Not even when a view is set up: the next update does it, once.
        self._plotter.suppress_rendering = True
        self.widget: QWidget = self._plotter
        self.widget.setAccessibleName("Point cloud")
        self._cloud, self._moved = Cloud(self._plotter), moved
        self._is_untouched, self._is_held = True, False
        self._watch = _Watch(mouse, self._resized, self.widget)
        self.widget.installEventFilter(self._watch)
        self.widget.setMouseTracking(True)
        self._plotter.render_window.AddObserver("StartEvent", lambda *_: self._begin())
        self._plotter.frameSwapped.connect(self._drawn)
        style = self._plotter.iren.interactor.GetInteractorStyle()
        style.AddObserver("StartInteractionEvent", lambda *_: self._touched())
        style.AddObserver("EndInteractionEvent", lambda *_: self._let_go())
        self._timer = QTimer(self.widget)
        self._timer.setSingleShot(True)
        self._timer.setInterval(SETTLE_MS)
        self._timer.timeout.connect(self._rest)
        self._grower = QTimer(self.widget)
        self._grower.setSingleShot(True)
        self._grower.setInterval(GROW_MS)
        self._grower.timeout.connect(self._plotter.update)
        #: Pictures wanted until the cloud grows, whether it ever will, when the picture at hand was begun.
        self._wanted = 0
        self._is_grown = False
        self._begun: float | None = None
        #: What to show in the next turn; at first after a picture, which is slow enough when it is empty.
        self._waiting: tuple[Points, NDArray[np.uint8]] | None = None
        self._is_ready = False

    def _touched(self) -> None:
        self._is_untouched, self._is_held = False, True
        self._be_coarse()

    def _let_go(self) -> None:
        self._is_held = False
        self._rest()

    def _be_coarse(self) -> None:
        self._wanted = 0
        self._cloud.be_coarse(True)

    def _resized(self) -> None:
        # Until a person turns the view, it fits the cloud into whatever size the layout settles on.
        if self._is_untouched:
            self._cloud.reset(self.widget.width(), self.widget.height())

    def _rest(self) -> None:
        if self._is_held:
            # A marker that was moved just before, or new colours, must not slow down who turns the view.
            self._plotter.update()
            return
        self._cloud.be_coarse(False)
        self._wanted = 0 if self._is_grown else PICTURES
        self._plotter.update()
        self._moved()

    @property
    def shown(self) -> int:
        """How many points are drawn at rest."""
        return self._cloud.shown

    def show_cloud(self, points: Points, colours: NDArray[np.uint8]) -> None:
        """Show points with their colours, as many as this machine draws in time."""
        # Colours were made just now: taking them in is a turn of its own, and the picture another.
        self._waiting = points, colours
        if self._is_ready:
            QTimer.singleShot(GROW_MS, self.widget, self._show_waiting)

    def _make_ready(self) -> None:
        if self._is_ready:
            return
        self._is_ready = True
        self._plotter.add_axes(interactive=False, color="#808080")
        QTimer.singleShot(GROW_MS, self.widget, self._show_waiting)

    def _show_waiting(self) -> None:
        waiting, self._waiting = self._waiting, None
        if waiting is None:
            self._plotter.update()
            return
        self.widget.setUpdatesEnabled(False)
        QTimer.singleShot(GROW_MS, self.widget, lambda: self.widget.setUpdatesEnabled(True))
        if self._cloud.show(*waiting):
            self.reset()
        self._is_grown = False
        self._rest()

    def _begin(self) -> None:
        self._begun = time.perf_counter()

    def _drawn(self) -> None:
        """A picture is on the screen: after the last one wanted, add to the cloud if that was quick."""
        if self._begun is None:
            return
        seconds, self._begun = time.perf_counter() - self._begun, None
        if not self._is_ready:
            QTimer.singleShot(GROW_MS, self.widget, self._make_ready)
            return
        if self._wanted == 0:
            return
        self._wanted -= 1
        if self._wanted == 0:
            self._is_grown = not self._cloud.grow(seconds)
            self._wanted = 0 if self._is_grown else PICTURES
        if self._wanted:
            self._grower.start()

    def show_marker(self, point: Points | None, colour: str) -> None:
        """Mark a point; the cloud is coarse until it rests."""
        rgb = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)[None]
        points = np.empty((0, 3), np.float32) if point is None else point[None]
        self._cloud.mark("marker", points, rgb, 14)
        self._be_coarse()
        self._timer.start()
        self._plotter.update()

    def show_pins(self, points: Points, colours: NDArray[np.uint8]) -> None:
        """Mark some points for good."""
        self._cloud.mark("pins", points, colours, 10)
        self._plotter.update()

    def set_background(self, colour: str) -> None:
        """The colour behind the cloud."""
        self._plotter.set_background(colour)
        self._plotter.update()

    def projection(self) -> NDArray[np.float64]:
        """The 4 x 4 matrix from points to normalised screen coordinates."""
        return self._cloud.projection(self.widget.width(), self.widget.height())

    def reset(self) -> None:
        """Look from where the camera stood."""
        self._is_untouched = True
        self._cloud.reset(self.widget.width(), self.widget.height())
        self._moved()
        self._plotter.update()

    def close(self) -> None:
        """Let go of the graphics context."""
        self._timer.stop()
        self._grower.stop()
        self._plotter.close()


def normalised(position: QPointF, widget: QWidget) -> tuple[float, float]:
    """A place on a widget in normalised screen coordinates, -1 to 1, y upwards."""
    return (
        2 * position.x() / max(widget.width(), 1) - 1,
        1 - 2 * position.y() / max(widget.height(), 1),
    )
