"""What all pictures share: colour scales, hatching, steps of the arrow keys, and a rectangle to drag."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, QRect, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QDragLeaveEvent, QKeyEvent, QPainter, QPen
from PySide6.QtWidgets import QGraphicsRectItem

from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.hints import hint, is_said_below

#: Perceptually uniform maps of pyqtgraph: grey for a band, colours for quantities that are not light.
GREY, DEPTH, SHARE = "CET-L1", "viridis", "cividis"
#: Differences: white is zero, blue negative, red positive; lightness changes evenly.
DIFFERENCE = "CET-D1A"
#: Zero of a difference. The map's own is pink, as between its arms it passes from violet to orange.
ZERO = (245, 245, 245)


class Canvas(pg.GraphicsLayoutWidget):  # type: ignore[misc]
    """What pictures and plots are drawn on; what can be done with them is said in the status line."""

    def __init__(self, name: str, tip: str = "") -> None:
        super().__init__()
        hint(self, name, tip)

    def event(self, event: QEvent) -> bool:
        """Leave out a tooltip that the status line has already."""
        return False if is_said_below(self, event) else bool(super().event(event))

    def dragLeaveEvent(self, event: QDragLeaveEvent) -> None:
        """What is dragged never entered: pyqtgraph leaves it to the window. Qt would warn of that."""


class Picture(pg.ImageItem):  # type: ignore[misc]
    """A picture that is gone from the screen once it is cleared.

    pyqtgraph lets Qt paint the place of a cleared picture, which is empty by then. Its view may so keep what
    it showed until something else is painted there.
    """

    def __init__(self) -> None:
        super().__init__(axisOrder="row-major")

    def clear(self) -> None:
        """Show nothing."""
        super().clear()
        scene = self.scene()
        for view in () if scene is None else scene.views():
            view.viewport().update()


class NoValues(QGraphicsRectItem):
    """Hatching below a picture: seen where that has no value, which no dark surface looks like."""

    def __init__(self, box: pg.ViewBox) -> None:
        super().__init__()
        self.setPen(QPen(Qt.PenStyle.NoPen))
        self.setZValue(-10)
        self._theme = DARK
        self.setAcceptedMouseButtons(Qt.MouseButton.NoButton)
        self.hide()
        box.addItem(self, ignoreBounds=True)

    def lie_under(self, shape: tuple[int, ...]) -> None:
        """Fill the place of a picture (rows, columns, ...); pixels have their centres at whole numbers."""
        self.setRect(-0.5, -0.5, shape[1], shape[0])
        self.show()

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        self.update()

    def paint(self, painter: QPainter, *_: object) -> None:
        """Hatch in pixels of the screen: the zoom of the picture would make beams of the lines."""
        place = painter.transform().mapRect(self.rect())
        painter.save()
        painter.resetTransform()
        hatch(painter, place, self._theme)
        painter.restore()


def hatch(painter: QPainter, place: QRectF | QRect, theme: Theme) -> None:
    """Hatch a place, in pixels of the painter, as the ground of a picture that has pixels without a value."""
    # A single pixel may lie between two lines.
    painter.fillRect(place, QColor(theme.line))
    painter.fillRect(place, QBrush(QColor(theme.muted), Qt.BrushStyle.BDiagPattern))


class PictureView(Canvas):
    """A picture with square pixels, its first row at the top, on a background of the theme."""

    def __init__(self, name: str, tip: str = "", box: pg.ViewBox | None = None) -> None:
        """``box`` holds the picture; the default one pans and zooms."""
        super().__init__(name, tip)
        self.box = box or pg.ViewBox(lockAspect=True, invertY=True, enableMenu=False)
        self.addItem(self.box, 0, 0)
        self.image = Picture()
        self.box.addItem(self.image)

    def fit(self, padding: float = 0.01) -> None:
        """Show the whole picture."""
        self.box.autoRange(padding=padding, items=[self.image])

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self.setBackground(theme.surround)


def colour_map(name: str) -> Any:
    """A colour map of pyqtgraph; that of differences is white at zero."""
    found = pg.colormap.get(name)
    return _white_at_zero(found) if name == DIFFERENCE else found


def _white_at_zero(found: Any) -> Any:
    """A map whose middle is `ZERO`; what that takes fades towards both ends, which stay."""
    places = np.linspace(0, 1, 129)
    colours = found.map(places, mode="float")[:, :3] * 255
    fades = (1 - np.abs(2 * places - 1))[:, None] ** 2
    colours += fades * (np.array(ZERO) - colours[64])
    return pg.ColorMap(places, np.rint(colours.clip(0, 255)).astype(np.uint8))


# Arrow keys --------------------------------------------------------------------------------------

_STEPS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Up: (0, -1),
    Qt.Key.Key_Down: (0, 1),
}
#: How much further a step goes with Shift.
WITH_SHIFT = 10


def arrow_step(event: QKeyEvent) -> tuple[int, int] | None:
    """Steps to the right and down of an arrow key, ten times as far with Shift; None for other keys."""
    step = _STEPS.get(Qt.Key(event.key()))
    if step is None:
        return None
    by = WITH_SHIFT if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1
    return by * step[0], by * step[1]


def moved_within(pixel: tuple[int, int], step: tuple[int, int], size: tuple[int, int]) -> tuple[int, int]:
    """A pixel (x, y) after a step, kept in an image of (width, height).

    >>> moved_within((3, 0), (10, -1), (8, 6))
    (7, 0)
    """
    x, y = (min(max(at + by, 0), most - 1) for at, by, most in zip(pixel, step, size, strict=True))
    return x, y


# Region ------------------------------------------------------------------------------------------

#: Region of an image as x, y, width, height in its pixels.
Region = tuple[int, int, int, int]
#: The first region: the middle part of the picture, of this share in width and height.
FIRST_SHARE = 0.4


class RegionBox(pg.RectROI):  # type: ignore[misc]
    """A rectangle to drag by itself or its corners, on an image with cells of ``cell_px`` pixels a side."""

    def __init__(self, cell_px: int) -> None:
        super().__init__((0, 0), (1, 1), sideScalers=True)
        self.addScaleHandle((0, 0), (1, 1))
        self._cell_px = cell_px

    def put_in_middle(self, width_px: int, height_px: int) -> None:
        """Cover the middle of an image of this size."""
        wide, high = (size * FIRST_SHARE / self._cell_px for size in (width_px, height_px))
        self.setPos((width_px / self._cell_px - wide) / 2, (height_px / self._cell_px - high) / 2)
        self.setSize((wide, high))

    def region(self, width_px: int, height_px: int) -> Region:
        """The covered region: whole cells within the image, at least one."""
        cell = self._cell_px
        left, top = self.pos().x(), self.pos().y()
        right, bottom = left + self.size().x(), top + self.size().y()
        x0, y0 = (_within(at, 0, size // cell - 1) for at, size in ((left, width_px), (top, height_px)))
        x1, y1 = (
            _within(at, low + 1, size // cell)
            for at, low, size in ((right, x0, width_px), (bottom, y0, height_px))
        )
        return x0 * cell, y0 * cell, (x1 - x0) * cell, (y1 - y0) * cell

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self.setPen(pg.mkPen(theme.accent, width=2))
        self.hoverPen = pg.mkPen(theme.accent, width=3)
        handles: list[Any] = self.getHandles()
        for handle in handles:
            handle.pen = pg.mkPen(theme.accent, width=2)
            handle.currentPen = handle.pen


def _within(value: float, low: int, high: int) -> int:
    return min(max(round(value), low), high)


def cut(pixels: Any, region: Region | None) -> Any:
    """The part of a mosaic that a region covers; all of it for None."""
    if region is None:
        return pixels
    x, y, width, height = region
    return pixels[y : y + height, x : x + width]
