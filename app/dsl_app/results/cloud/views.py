"""Widgets that show a point cloud: interactive where VTK can draw, else a static picture."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPointF, Qt, QTimer, Signal
from PySide6.QtGui import (
    QColor,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPixmap,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from dsl_app.results.cloud.look import Grid, Look, Points, Side
from dsl_app.results.cloud.overlay import Overlay, OverlayPainter
from dsl_app.results.cloud.render_window import Colours, MouseButton, Rendering, graphics_work
from dsl_app.results.cloud.renderer import CloudRenderer
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.hints import FocusRing
from dsl_app.shared.widgets.layouts import column_of
from dsl_app.shared.widgets.pictures import arrow_step

#: One notch of a mouse wheel, in Qt's unit.
NOTCH = 120
NO_OPENGL = (
    "OpenGL was not found, so the cloud cannot be rotated here. Export it as PLY to view it in another"
    " program, or install a graphics driver."
)
#: Said with the reason where 3D begins and then fails.
BROKEN = (
    "3D could not be drawn ({}), so this picture cannot be rotated. Update the graphics driver and start the"
    " program again. Until then, export the cloud as PLY to view it in another program."
)
#: Shown until the first picture of a cloud is there, and what is added after a while.
DRAWING = "Drawing the first 3D picture…"
SLOW = "Without a graphics card this can take a minute. Everything else can be used meanwhile."
SLOW_MS = 3000
#: Said where no point is to be drawn.
NO_POINTS = "No point is shown: the result has none, or none within the limits of depth."
_BUTTONS: dict[Qt.MouseButton, MouseButton] = {
    Qt.MouseButton.LeftButton: "Left",
    Qt.MouseButton.MiddleButton: "Middle",
    Qt.MouseButton.RightButton: "Right",
}


class CloudView(QWidget):
    """Shows a cloud; this base has one fixed view without marks."""

    def show_cloud(
        self, points: Points, colours: Colours, reset_view: bool = True, grid: Grid | None = None
    ) -> None:
        """Show points (n, 3) in mm with colours (n, 3); other points reset the view, or keep it.

        With the ``grid`` that they come from, the surface between them can be drawn.
        """
        raise NotImplementedError

    def take_look(self, look: Look) -> None:
        """Draw something else."""

    def see_from(self, side: Side) -> None:
        """Look from a side."""

    def show_overlay(self, overlay: Overlay) -> None:
        """Draw what is measured over the picture."""

    def show_marker(self, point: Points | None, colour: str) -> None:
        """Mark a point; None marks nothing."""

    def show_pins(self, points: Points, colours: Colours) -> None:
        """Mark the pins."""

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme to what is behind the cloud and written over it."""
        raise NotImplementedError

    def projection(self) -> NDArray[np.float64]:
        """The 4 x 4 matrix from points to normalised screen coordinates; by zeros nothing is visible."""
        return np.zeros((4, 4))

    def reset(self) -> None:
        """Look from the position of the camera."""

    def release(self) -> None:
        """Release the graphics."""


def prepare_cloud_view() -> bool:
    """Import what a view needs, in any thread, for a second or so; False where nothing can draw."""
    import pyvista.plotting

    # What pyvista imports only when a plotter is made.
    import vtkmodules.vtkInteractionWidgets
    import vtkmodules.vtkViewsContext2D  # noqa: F401

    # The first points ever make pyvista import more than later ones.
    pyvista.PolyData(np.zeros((1, 3), np.float32))["colours"] = np.zeros((1, 3), np.uint8)
    return graphics_work()


def make_cloud_view(
    can_draw: bool, moved: Callable[[], object], mouse: Callable[[QMouseEvent], bool]
) -> CloudView:
    """An interactive view where VTK can draw, else a static one.

    ``moved`` is called when the view changes; ``mouse`` may consume mouse events, which then rotate nothing.
    """
    return InteractiveCloud(moved, mouse) if can_draw else StaticCloud(NO_OPENGL)


class InteractiveCloud(CloudView):
    """Shows the pictures of a `CloudRenderer` and forwards mouse, wheel and keys to it.

    ``failed`` holds why nothing can be drawn any more.
    """

    failed = Signal(str)
    _drawn = Signal()

    def __init__(self, moved: Callable[[], object], mouse: Callable[[QMouseEvent], bool]) -> None:
        super().__init__()
        self._moved, self._mouse = moved, mouse
        self.image, self._pixels = QImage(), np.empty(0, np.uint8)
        self._theme, self._overlay = DARK, Overlay()
        self._seen: Rendering | None = None
        #: What is said instead of a picture, until there is one of the cloud.
        self.waiting = DRAWING
        self._is_empty = False
        QTimer.singleShot(SLOW_MS, self, self.say_more)
        self.setAccessibleName("Point cloud")
        self.setAccessibleDescription("Arrow keys rotate, plus and minus zoom, Home resets the view")
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        FocusRing(self)
        self._drawn.connect(self._take)
        self.renderer = CloudRenderer(self._drawn.emit)

    # Show ------------------------------------------------------------------------------------------

    def show_cloud(
        self, points: Points, colours: Colours, reset_view: bool = True, grid: Grid | None = None
    ) -> None:
        """Show points with their colours, as many as this computer draws in time."""
        self._is_empty = not len(points)
        self.update()
        self.renderer.show(points, colours, reset_view, grid)

    def take_look(self, look: Look) -> None:
        """Draw something else."""
        self.renderer.take_look(look)

    def see_from(self, side: Side) -> None:
        """Look from a side."""
        self.renderer.call(lambda window: window.see_from(side))

    def show_overlay(self, overlay: Overlay) -> None:
        """Draw what is measured over the picture."""
        self._overlay = overlay
        self.update()

    def show_marker(self, point: Points | None, colour: str) -> None:
        """Mark a point; the cloud is coarse until the marker rests."""
        rgb = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)[None]
        points = np.empty((0, 3), np.float32) if point is None else point[None]
        size_px = round(14 * self.devicePixelRatioF())
        self.renderer.call(lambda window: window.marks.show("marker", points, rgb, size_px), moves=True)

    def show_pins(self, points: Points, colours: Colours) -> None:
        """Mark the pins."""
        size_px = round(10 * self.devicePixelRatioF())
        self.renderer.call(lambda window: window.marks.show("pins", points, colours, size_px))

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme, also where there is no picture yet."""
        self._theme = theme
        self.renderer.call(lambda window: window.set_background(theme.raised))
        self.update()

    def projection(self) -> NDArray[np.float64]:
        """The 4 x 4 matrix of the picture shown."""
        return np.zeros((4, 4)) if self._seen is None else self._seen.projection

    def reset(self) -> None:
        """Look from the position of the camera."""
        self.renderer.call(lambda window: window.reset())

    def release(self) -> None:
        """End the render thread."""
        self.renderer.close()

    def say_more(self) -> None:
        """Say why it takes long, unless there is a picture by now."""
        if self.waiting:
            self.waiting = f"{DRAWING}\n{SLOW}"
            self.update()

    def _take(self) -> None:
        if self.renderer.trouble:
            self.failed.emit(self.renderer.trouble)
            return
        picture = self.renderer.take()
        if self.renderer.shown:
            self.waiting = ""
        if picture is None:
            return
        before, self._seen = self.projection(), picture
        self._show(picture)
        if not np.array_equal(picture.projection, before):
            self._moved()

    def _show(self, picture: Rendering) -> None:
        height, width = picture.pixels.shape[:2]
        # QImage only points to these bytes, so they have to stay.
        self._pixels = picture.pixels
        self.image = QImage(self._pixels.data, width, height, 4 * width, QImage.Format.Format_RGBX8888)
        self.image.setDevicePixelRatio(self.devicePixelRatioF())
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the latest picture."""
        painter = QPainter(self)
        painter.fillRect(event.rect(), QColor(self._theme.raised))
        painter.drawImage(0, 0, self.image)
        # An empty view has no scale that a bar could tell.
        told = NO_POINTS if self._is_empty else self.waiting
        if self._seen is not None and not told:
            theme = self._theme
            size, inks = (self.width(), self.height()), (theme.text, theme.accent, theme.raised)
            OverlayPainter(painter, *size, *inks).paint(self._seen, self._overlay)
        if told:
            painter.setPen(QColor(self._theme.muted))
            centred = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
            painter.drawText(self.rect().adjusted(20, 20, -20, -20), centred, told)
        painter.end()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Request pictures of the new size."""
        self._resize_pictures()

    def event(self, event: QEvent) -> bool:
        """Request pictures of the new size also when the window moves to a screen of another scaling."""
        if event.type() is QEvent.Type.DevicePixelRatioChange:
            self._resize_pictures()
        return super().event(event)

    def _resize_pictures(self) -> None:
        width, height = self._px(QPointF(self.width(), self.height()))
        self.renderer.call(lambda window: window.resize(width, height))

    def _px(self, at: QPointF) -> tuple[int, int]:
        ratio = self.devicePixelRatioF()
        return round(at.x() * ratio), round(at.y() * ratio)

    # Mouse and keys --------------------------------------------------------------------------------

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Start to rotate, pan or zoom, unless the event is consumed."""
        button = _BUTTONS.get(event.button())
        if not self._mouse(event) and button is not None:
            self.renderer.press(button, self._px(event.position()), *_modifiers(event))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Continue to rotate, pan or zoom."""
        if not self._mouse(event) and event.buttons():
            at, modifiers = self._px(event.position()), _modifiers(event)
            self.renderer.call(lambda window: window.move(at, *modifiers))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Stop rotating, panning or zooming."""
        button = _BUTTONS.get(event.button())
        if not self._mouse(event) and button is not None:
            self.renderer.release(button, self._px(event.position()))

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom."""
        self._zoom(event.angleDelta().y() / NOTCH)

    def _zoom(self, steps: float) -> None:
        self.renderer.call(lambda window: window.zoom(steps), moves=True)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Rotate and zoom by keys."""
        step = arrow_step(event)
        if step is not None:
            self.renderer.call(lambda window: window.turn(step[0], -step[1]), moves=True)
        elif event.key() in (Qt.Key.Key_Plus, Qt.Key.Key_Equal, Qt.Key.Key_Minus):
            self._zoom(-1.0 if event.key() == Qt.Key.Key_Minus else 1.0)
        elif event.key() == Qt.Key.Key_Home:
            self.reset()
        else:
            super().keyPressEvent(event)


def _modifiers(event: QMouseEvent) -> tuple[bool, bool]:
    """Whether Shift and Control are held."""
    keys = event.modifiers()
    return bool(keys & Qt.KeyboardModifier.ShiftModifier), bool(keys & Qt.KeyboardModifier.ControlModifier)


class StaticCloud(CloudView):
    """Where 3D does not work: one picture of the cloud, slightly from the side; ``why`` and what to do."""

    def __init__(self, why: str) -> None:
        super().__init__()
        self._picture = label("", "muted", wraps=True, name="Picture of the point cloud")
        self._picture.setAlignment(Qt.AlignmentFlag.AlignCenter)
        # It fits into its room, whatever that is, and asks for none.
        self._picture.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)
        self._whole = QPixmap()
        column_of((self._picture, 1), label(why, "muted", wraps=True), on=self, margins=0)
        self._background = "#000000"
        self._drawn: tuple[Points, Colours] | None = None

    def show_cloud(
        self, points: Points, colours: Colours, reset_view: bool = True, grid: Grid | None = None
    ) -> None:
        """Draw points into a picture."""
        self._drawn = points, colours
        picture = static_picture(points, colours, self._background)
        if picture is None:
            self._whole = QPixmap()
            self._picture.setText(NO_POINTS)
            return
        height, width = picture.shape[:2]
        image = QImage(picture.data, width, height, 3 * width, QImage.Format.Format_RGB888).copy()
        self._whole = QPixmap.fromImage(image)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Fit the picture into the new size."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        if not self._whole.isNull():
            keep, smooth = Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
            self._picture.setPixmap(self._whole.scaled(self._picture.size(), keep, smooth))

    def apply_theme(self, theme: Theme) -> None:
        """Set the colour behind and around the picture."""
        self._background = theme.raised
        self._picture.setStyleSheet(f"background: {theme.raised}")
        if self._drawn is not None:
            self.show_cloud(*self._drawn)


def static_picture(points: Points, colours: Colours, background: str) -> NDArray[np.uint8] | None:
    """A cloud as bytes (rows, columns, 3), drawn by numpy alone; None without points.

    Painted from back to front, so that near points cover far ones.
    """
    if len(points) == 0:
        return None
    width, height = 640, 480
    centre = np.median(points, axis=0)
    turn = np.radians(20.0)
    moved = points - centre
    x = moved[:, 0] * np.cos(turn) + moved[:, 2] * np.sin(turn)
    z = moved[:, 2] * np.cos(turn) - moved[:, 0] * np.sin(turn)
    scale = min(width / np.ptp(x), height / np.ptp(moved[:, 1])) * 0.94 if np.ptp(x) > 0 else 1.0
    column = np.rint((x - (x.min() + x.max()) / 2) * scale + width / 2).astype(int)
    row = np.rint((moved[:, 1] - (moved[:, 1].min() + moved[:, 1].max()) / 2) * scale + height / 2).astype(
        int
    )
    picture = np.empty((height, width, 3), np.uint8)
    picture[:] = tuple(bytes.fromhex(background[1:]))
    back_to_front = np.argsort(-z)
    seen = (column >= 1) & (column < width - 1) & (row >= 1) & (row < height - 1)
    order = back_to_front[seen[back_to_front]]
    for dy, dx in ((0, 0), (0, 1), (1, 0), (1, 1)):
        picture[row[order] + dy, column[order] + dx] = colours[order]
    return np.ascontiguousarray(picture)


def normalised(position: QPointF, widget: QWidget) -> tuple[float, float]:
    """A place on a widget in normalised screen coordinates, -1 to 1, y upwards."""
    return (
        2 * position.x() / max(widget.width(), 1) - 1,
        1 - 2 * position.y() / max(widget.height(), 1),
    )
