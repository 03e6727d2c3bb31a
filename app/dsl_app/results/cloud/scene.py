"""Points in space behind a small protocol: by VTK where it can draw, else as a picture and a sentence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPointF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from dsl_app.results.cloud.points import Points
from dsl_app.results.cloud.render_window import MouseButton, Picture, graphics_work
from dsl_app.results.cloud.renderer import Artist
from dsl_app.results.cloud.still_scene import StillScene
from dsl_app.shared.widgets.pictures import arrow_step

#: A notch of a mouse's wheel, in the unit that Qt counts in.
NOTCH = 120
_BUTTONS: dict[Qt.MouseButton, MouseButton] = {
    Qt.MouseButton.LeftButton: "Left",
    Qt.MouseButton.MiddleButton: "Middle",
    Qt.MouseButton.RightButton: "Right",
}


class Scene(Protocol):
    """Shows a cloud; tells where the mouse points in normalised screen coordinates."""

    widget: QWidget

    def show_cloud(self, points: Points, colours: NDArray[np.uint8], anew: bool = True) -> None:
        """Show points (n, 3) in mm with colours (n, 3); other points are looked at ``anew``, or as is."""

    def show_marker(self, point: Points | None, colour: str) -> None:
        """Mark a point; None marks nothing."""

    def show_pins(self, points: Points, colours: NDArray[np.uint8]) -> None:
        """Mark some points for good."""

    def set_background(self, colour: str) -> None:
        """The colour behind the cloud."""

    def projection(self) -> NDArray[np.float64]:
        """The 4 x 4 matrix from points to normalised screen coordinates, of what is to be seen."""

    def reset(self) -> None:
        """Look from where the camera stood."""

    def close(self) -> None:
        """Let go of the graphics."""


def prepare_scene() -> bool:
    """Import what a scene needs, for a second or so in any thread; False where nothing can draw one."""
    import pyvista.plotting

    # What pyvista imports no sooner than when a scene is made.
    import vtkmodules.vtkInteractionWidgets
    import vtkmodules.vtkViewsContext2D  # noqa: F401

    # The first points of all look for more of pyvista than those that follow.
    pyvista.PolyData(np.zeros((1, 3), np.float32))["colours"] = np.zeros((1, 3), np.uint8)
    return graphics_work()


def make_scene(is_drawn: bool, moved: Callable[[], object], mouse: Callable[[QMouseEvent], bool]) -> Scene:
    """A scene that can be turned where one can be drawn.

    ``moved`` hears of new views, ``mouse`` may take events of the mouse, which then turn nothing.
    """
    return TurnedScene(moved, mouse) if is_drawn else StillScene()


class SceneWidget(QWidget):
    """Shows the pictures of an `Artist` and hands it what mouse, wheel and keys ask for."""

    _drawn = Signal()

    def __init__(self, moved: Callable[[], object], mouse: Callable[[QMouseEvent], bool]) -> None:
        super().__init__()
        self._moved, self._mouse = moved, mouse
        self.image, self._pixels = QImage(), np.empty(0, np.uint8)
        self._background = QColor()
        self.projection = np.zeros((4, 4))
        self.setAccessibleName("Point cloud")
        self.setAccessibleDescription("Arrow keys turn it, plus and minus zoom, Home looks as the camera did")
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self._drawn.connect(self._take)
        self.artist = Artist(self._drawn.emit)

    def _take(self) -> None:
        picture = self.artist.take()
        if picture is None:
            return
        self._show(picture)
        if not np.array_equal(picture.projection, self.projection):
            self.projection = picture.projection
            self._moved()

    def _show(self, picture: Picture) -> None:
        height, width = picture.pixels.shape[:2]
        # The image only looks at the bytes, which therefore stay.
        self._pixels = picture.pixels
        self.image = QImage(self._pixels.data, width, height, 4 * width, QImage.Format.Format_RGBX8888)
        self.image.setDevicePixelRatio(self.devicePixelRatioF())
        self.update()

    def set_background(self, colour: str) -> None:
        """The colour behind the cloud, and where there is no picture yet."""
        self._background = QColor(colour)
        self.artist.set_background(colour)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Show the latest picture."""
        painter = QPainter(self)
        painter.fillRect(event.rect(), self._background)
        painter.drawImage(0, 0, self.image)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Ask for pictures of the new size."""
        self._ask_for_size()

    def event(self, event: QEvent) -> bool:
        """Ask for pictures of the new size when the window goes to a screen of another scaling, too."""
        if event.type() is QEvent.Type.DevicePixelRatioChange:
            self._ask_for_size()
        return super().event(event)

    def _ask_for_size(self) -> None:
        self.artist.resize(*self._px(QPointF(self.width(), self.height())))

    def _px(self, at: QPointF) -> tuple[int, int]:
        ratio = self.devicePixelRatioF()
        return round(at.x() * ratio), round(at.y() * ratio)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Turn, move or zoom from here, unless somebody else takes the event."""
        button = _BUTTONS.get(event.button())
        if not self._mouse(event) and button is not None:
            self.artist.press(button, self._px(event.position()), *_held(event))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Go on."""
        if not self._mouse(event) and event.buttons():
            self.artist.move(self._px(event.position()), *_held(event))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Let go."""
        button = _BUTTONS.get(event.button())
        if not self._mouse(event) and button is not None:
            self.artist.release(button, self._px(event.position()))

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom."""
        self.artist.zoom(event.angleDelta().y() / NOTCH)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Turn and zoom by keys."""
        step = arrow_step(event)
        if step is not None:
            self.artist.turn(step[0], -step[1])
        elif event.key() in (Qt.Key.Key_Plus, Qt.Key.Key_Equal, Qt.Key.Key_Minus):
            self.artist.zoom(-1.0 if event.key() == Qt.Key.Key_Minus else 1.0)
        elif event.key() == Qt.Key.Key_Home:
            self.artist.reset()
        else:
            super().keyPressEvent(event)


def _held(event: QMouseEvent) -> tuple[bool, bool]:
    keys = event.modifiers()
    return bool(keys & Qt.KeyboardModifier.ShiftModifier), bool(keys & Qt.KeyboardModifier.ControlModifier)


class TurnedScene:
    """A scene that is drawn in a thread of its own and can be turned; coarse while it turns."""

    def __init__(self, moved: Callable[[], object], mouse: Callable[[QMouseEvent], bool]) -> None:
        self.widget: Any = SceneWidget(moved, mouse)
        self._artist: Artist = self.widget.artist

    @property
    def shown(self) -> int:
        """How many points are drawn at rest."""
        return self._artist.shown

    @property
    def is_at_rest(self) -> bool:
        """Whether all that was asked for is drawn, with as many points as this machine draws in time."""
        return self._artist.is_at_rest

    def show_cloud(self, points: Points, colours: NDArray[np.uint8], anew: bool = True) -> None:
        """Show points with their colours, as many as this machine draws in time."""
        self._artist.show(points, colours, anew)

    def show_marker(self, point: Points | None, colour: str) -> None:
        """Mark a point; the cloud is coarse until it rests."""
        rgb = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)[None]
        points = np.empty((0, 3), np.float32) if point is None else point[None]
        self._artist.mark("marker", points, rgb, self._px(14), moves=True)

    def show_pins(self, points: Points, colours: NDArray[np.uint8]) -> None:
        """Mark some points for good."""
        self._artist.mark("pins", points, colours, self._px(10))

    def _px(self, size: int) -> int:
        ratio: float = self.widget.devicePixelRatioF()
        return round(size * ratio)

    def set_background(self, colour: str) -> None:
        """The colour behind the cloud."""
        self.widget.set_background(colour)

    def projection(self) -> NDArray[np.float64]:
        """The 4 x 4 matrix from points to normalised screen coordinates, of what is to be seen."""
        projection: NDArray[np.float64] = self.widget.projection
        return projection

    def reset(self) -> None:
        """Look from where the camera stood."""
        self._artist.reset()

    def close(self) -> None:
        """End the thread that draws."""
        self._artist.close()


def normalised(position: QPointF, widget: QWidget) -> tuple[float, float]:
    """A place on a widget in normalised screen coordinates, -1 to 1, y upwards."""
    return (
        2 * position.x() / max(widget.width(), 1) - 1,
        1 - 2 * position.y() / max(widget.height(), 1),
    )
