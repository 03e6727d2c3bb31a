"""A view box to draw outlines on: rectangles, ellipses and lassos by dragging, polygons by clicking."""

from __future__ import annotations

import math
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal

#: A lasso gets a corner whenever the mouse has moved this far, screen px.
LASSO_STEP_PX = 3.0
#: Corners of an ellipse: the polygon cuts off less than a thousandth of its radius.
ELLIPSE_CORNERS = 90

Corners = tuple[tuple[float, float], ...]


class OutlineBox(pg.ViewBox):  # type: ignore[misc]
    """Emits ``clicked`` with image coordinates, or ``drawn`` with a closed outline.

    ``tool`` is empty (clicks only; dragging pans), ``rectangle``, ``ellipse``, ``polygon`` or ``lasso``.
    """

    clicked = Signal(float, float)
    drawn = Signal(object)

    def __init__(self) -> None:
        super().__init__(lockAspect=True, invertY=True, enableMenu=False)
        self.tool = ""
        self._corners: list[tuple[float, float]] = []
        self._last = (0.0, 0.0)
        self._preview = pg.PlotCurveItem(pen=pg.mkPen("#ffffff", width=1.5, style=Qt.PenStyle.DashLine))
        self._preview.setZValue(50)
        self.addItem(self._preview, ignoreBounds=True)

    def set_tool(self, tool: str) -> None:
        """Draw with another tool; cancels an outline that is being drawn."""
        self.tool = tool
        self.cancel_outline()

    def set_colour(self, colour: str) -> None:
        """Set the colour of outlines while they are drawn."""
        self._preview.setPen(pg.mkPen(colour, width=1.5, style=Qt.PenStyle.DashLine))

    @property
    def is_drawing(self) -> bool:
        """Whether an outline has been started and not closed."""
        return bool(self._corners)

    def cancel_outline(self) -> None:
        """Discard the outline that is being drawn."""
        self._corners = []
        self._preview.setData([], [])

    def close_outline(self) -> None:
        """Close the outline; one with fewer than three corners is discarded."""
        corners = tuple(self._corners)
        self.cancel_outline()
        if len(corners) >= 3:
            self.drawn.emit(corners)

    def mouseClickEvent(self, event: Any) -> None:
        """Report a click, or add a corner to a polygon; a double or right click closes it."""
        at = self.mapSceneToView(event.scenePos())
        if self.tool != "polygon":
            if event.button() == Qt.MouseButton.LeftButton:
                event.accept()
                self.clicked.emit(at.x(), at.y())
            return
        event.accept()
        if event.button() == Qt.MouseButton.LeftButton and not event.double():
            self._corners.append((at.x(), at.y()))
            self._show(self._corners)
        else:
            self.close_outline()

    def mouseDragEvent(self, event: Any, axis: Any = None) -> None:
        """Draw with the left button if the tool does; otherwise pan as usual."""
        if self.tool not in (*_BETWEEN, "lasso") or event.button() != Qt.MouseButton.LeftButton:
            super().mouseDragEvent(event, axis)
            return
        event.accept()
        at = self.mapSceneToView(event.scenePos())
        if self.tool in _BETWEEN:
            start = self.mapSceneToView(event.buttonDownScenePos())
            self._corners = list(_BETWEEN[self.tool]((start.x(), start.y()), (at.x(), at.y())))
        else:
            self._follow(event, (at.x(), at.y()))
        self._show(self._corners)
        if event.isFinish():
            self.close_outline()

    def _follow(self, event: Any, at: tuple[float, float]) -> None:
        here = event.scenePos()
        if event.isStart():
            start = self.mapSceneToView(event.buttonDownScenePos())
            self._corners = [(start.x(), start.y())]
        elif abs(here.x() - self._last[0]) + abs(here.y() - self._last[1]) < LASSO_STEP_PX:
            return
        self._last = (here.x(), here.y())
        self._corners.append(at)

    def _show(self, corners: list[tuple[float, float]]) -> None:
        closed = [*corners, corners[0]]
        self._preview.setData([x for x, _ in closed], [y for _, y in closed])


def rectangle(a: tuple[float, float], b: tuple[float, float]) -> Corners:
    """Corners of the rectangle of whole pixels between two points."""
    x0, x1 = sorted((round(a[0]), round(b[0])))
    y0, y1 = sorted((round(a[1]), round(b[1])))
    return ((x0 - 0.5, y0 - 0.5), (x1 + 0.5, y0 - 0.5), (x1 + 0.5, y1 + 0.5), (x0 - 0.5, y1 + 0.5))


def ellipse(a: tuple[float, float], b: tuple[float, float]) -> Corners:
    """An ellipse that fills the rectangle of whole pixels between two points, as a polygon."""
    (x0, y0), _, (x1, y1), _ = rectangle(a, b)
    steps = (2 * math.pi * i / ELLIPSE_CORNERS for i in range(ELLIPSE_CORNERS))
    return tuple(
        ((x0 + x1 + (x1 - x0) * math.cos(turn)) / 2, (y0 + y1 + (y1 - y0) * math.sin(turn)) / 2)
        for turn in steps
    )


#: Outlines by the two ends of a drag.
_BETWEEN = {"rectangle": rectangle, "ellipse": ellipse}
