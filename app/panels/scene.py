"""Points in space behind a small protocol: by VTK where there is OpenGL, else as a picture or a sentence.

pyvista and its Qt window are imported here alone, when a cloud is first looked at.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QPointF, QTimer
from PySide6.QtGui import QGuiApplication, QMouseEvent, QOffscreenSurface, QOpenGLContext
from PySide6.QtWidgets import QWidget

from app.panels.still_scene import StillScene

Points = NDArray[np.float32]
#: Points drawn while the view turns, and a time per frame above which the rest picture is thinned too, s.
COARSE, SLOW_S = 30_000, 0.12
#: How long after the last move the whole cloud comes back, ms.
SETTLE_MS = 250
POINT_PX, COARSE_PX, LARGEST_PX = 2, 3, 6
#: Pixels of a view that a cloud covers, about; points that are few are drawn larger, so that it is no veil.
COVERED_PX = 200_000


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


def gl_works() -> bool:
    """Whether Qt can draw by OpenGL here: tried, not guessed."""
    if QGuiApplication.platformName() in ("offscreen", "minimal"):
        return False
    surface, context = QOffscreenSurface(), QOpenGLContext()
    surface.create()
    works = context.create() and context.makeCurrent(surface)
    context.doneCurrent()
    return bool(works)


def prepare_scene() -> None:
    """Import what a scene needs: seconds, in which a thread does not stop the window."""
    import pyvistaqt  # noqa: F401


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


class _Cloud:
    """The actors of a cloud in a pyvista plotter: coarse while it moves, whole at rest."""

    def __init__(self, plotter: Any) -> None:
        self.plotter = plotter
        self.actors: dict[str, Any] = {}
        self._meshes: dict[str, Any] = {}
        self._points: Points | None = None
        self._parts: dict[str, NDArray[np.int32]] = {}
        self._order = np.empty(0, np.int32)

    def show(self, points: Points, colours: NDArray[np.uint8]) -> bool:
        """Show a cloud; True when it is another than before, and not only of other colours."""
        if points is self._points:
            for name, index in self._parts.items():
                self._meshes[name]["colours"] = colours[index]
            return False
        self._points = points
        # A fixed random order, so that a part of the cloud is even and does not flicker.
        self._order = np.random.default_rng(0).permutation(len(points)).astype(np.int32)
        size_px = point_size(len(points))
        self._fill("whole", self._order, colours, size_px)
        self._fill("coarse", self._order[:COARSE], colours, max(size_px, COARSE_PX))
        self.be_coarse(False)
        return True

    def thin(self, count: int, colours: NDArray[np.uint8]) -> None:
        """Show no more than so many points at rest."""
        self._fill("whole", self._order[:count], colours, COARSE_PX)

    def _fill(self, name: str, index: NDArray[np.int32], colours: NDArray[np.uint8], size_px: int) -> None:
        assert self._points is not None
        self._parts[name] = index
        self._put(name, self._points[index], colours[index], size_px)

    def _put(self, name: str, points: Points, colours: NDArray[np.uint8], size_px: int) -> None:
        import pyvista

        if name in self.actors:
            self.plotter.remove_actor(self.actors.pop(name), reset_camera=False, render=False)
        if len(points) == 0:
            # VTK wants at least one point; this one is never in view.
            points, colours = np.full((1, 3), -1e6, np.float32), np.zeros((1, 3), np.uint8)
        mesh = pyvista.PolyData(np.ascontiguousarray(points))
        mesh["colours"] = colours
        self._meshes[name] = mesh
        self.actors[name] = self.plotter.add_mesh(
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
        """Show some points in front of the cloud's own."""
        # A little nearer to the eye that took them, so that their neighbours do not hide them.
        near = np.asarray(points * 0.997, np.float32)
        old = self._meshes.get(name)
        if old is not None and len(points) and old.n_points == len(points):
            old.points = near
            old["colours"] = colours
        else:
            self._put(name, near, colours, size_px)

    def be_coarse(self, coarse: bool) -> None:
        """Show fewer points, or all again."""
        if "whole" in self.actors:
            self.actors["whole"].SetVisibility(not coarse)
            self.actors["coarse"].SetVisibility(coarse)

    def reset(self, width: int, height: int) -> None:
        """Look along the camera's axis, as the picture does, so that all fits into a window's size."""
        if self._points is None or len(self._order) == 0:
            return
        low, high = np.percentile(self._points[self._order[:COARSE]], (0.5, 99.5), axis=0)
        centre, span = (low + high) / 2, (high - low) / 2
        camera = self.plotter.camera
        camera.position, camera.up, camera.focal_point = (0.0, 0.0, 0.0), (0.0, -1.0, 0.0), tuple(centre)
        reach = 1.1 * max(span[1], span[0] * height / max(width, 1))
        camera.view_angle = float(np.degrees(2 * np.arctan2(reach, low[2])))
        self.plotter.reset_camera_clipping_range()

    def projection(self, width: int, height: int) -> NDArray[np.float64]:
        """From points to normalised screen coordinates, 4 x 4."""
        matrix = self.plotter.camera.GetCompositeProjectionTransformMatrix(width / max(height, 1), -1, 1)
        return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


class GlScene:
    """A scene by VTK in an OpenGL widget; coarse while it turns or the marker moves."""

    def __init__(self, moved: Callable[[], object], mouse: Callable[[QMouseEvent], bool]) -> None:
        from pyvistaqt import QtInteractor

        # It renders when asked: neither every 200 ms nor with four samples a pixel.
        interactor: Any = QtInteractor
        self._plotter: Any = interactor(None, auto_update=False, multi_samples=0)
        self.widget: QWidget = self._plotter
        self.widget.setAccessibleName("Point cloud")
        self._cloud, self._moved = _Cloud(self._plotter), moved
        self._is_untouched = True
        self._watch = _Watch(mouse, self._resized, self.widget)
        self.widget.installEventFilter(self._watch)
        self.widget.setMouseTracking(True)
        self._plotter.add_axes(interactive=False, color="#808080")
        style = self._plotter.iren.interactor.GetInteractorStyle()
        style.AddObserver("StartInteractionEvent", lambda *_: self._touched())
        style.AddObserver("EndInteractionEvent", lambda *_: self._rest())
        self._timer = QTimer(self.widget)
        self._timer.setSingleShot(True)
        self._timer.setInterval(SETTLE_MS)
        self._timer.timeout.connect(self._rest)

    def _touched(self) -> None:
        self._is_untouched = False
        self._cloud.be_coarse(True)

    def _resized(self) -> None:
        # Until a person turns the view, it fits the cloud into whatever size the layout settles on.
        if self._is_untouched:
            self._cloud.reset(self.widget.width(), self.widget.height())

    def _rest(self) -> None:
        self._cloud.be_coarse(False)
        self._plotter.update()
        self._moved()

    def show_cloud(self, points: Points, colours: NDArray[np.uint8]) -> None:
        """Show points with their colours, as many as this machine draws in time."""
        if self._cloud.show(points, colours):
            self.reset()
            seconds = self._time_frame()
            if seconds > SLOW_S:
                self._cloud.thin(max(int(len(points) * SLOW_S / seconds), COARSE), colours)
        self._plotter.update()

    def _time_frame(self) -> float:
        """Seconds that the whole cloud takes to draw; the first frame also prepares and does not count."""
        for _ in range(2):
            start = time.perf_counter()
            self._plotter.render_window.Render()
        return time.perf_counter() - start

    def show_marker(self, point: Points | None, colour: str) -> None:
        """Mark a point; the cloud is coarse until it rests."""
        rgb = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)[None]
        points = np.empty((0, 3), np.float32) if point is None else point[None]
        self._cloud.mark("marker", points, rgb, 14)
        self._cloud.be_coarse(True)
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
        self._plotter.close()


def point_size(count: int) -> int:
    """Size of the points of a cloud, px.

    >>> point_size(500_000), point_size(14_000), point_size(100)
    (2, 4, 6)
    """
    return min(max(round((COVERED_PX / max(count, 1)) ** 0.5), POINT_PX), LARGEST_PX)


def normalised(position: QPointF, widget: QWidget) -> tuple[float, float]:
    """A place on a widget in normalised screen coordinates, -1 to 1, y upwards."""
    return (
        2 * position.x() / max(widget.width(), 1) - 1,
        1 - 2 * position.y() / max(widget.height(), 1),
    )
