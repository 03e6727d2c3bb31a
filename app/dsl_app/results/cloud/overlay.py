"""What is written and drawn over the 3D picture: scale bar, lengths of the box, measured lines, the lasso."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPen, QPolygonF

from dsl_app.results.cloud.render_window import Rendering
from dsl_core.evaluation.marks import on_screen
from dsl_core.evaluation.screen import mm_per_px, scale_bar

#: Longest scale bar, share of the width of the view, and its distance from the corner, px.
BAR_SHARE, MARGIN_PX = 0.22, 12.0
Line = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass
class Overlay:
    """What a person measures or draws: points and a line between points, mm, and a lasso, normalised."""

    points_mm: Sequence[NDArray[np.float64]] = ()
    line: Line | None = None
    lasso: list[tuple[float, float]] = field(default_factory=list)


class OverlayPainter:
    """Paints on a view of ``width`` and ``height``, px; colours are ``#rrggbb``."""

    def __init__(self, painter: QPainter, width: int, height: int, ink: str, accent: str, base: str) -> None:
        self._painter, self._width, self._height = painter, width, height
        self._ink, self._accent, self._base = QColor(ink), QColor(accent), QColor(base)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)

    def paint(self, seen: Rendering, overlay: Overlay) -> None:
        """Paint all of it."""
        if seen.box_mm is not None:
            self._box(seen, *seen.box_mm)
        self._bar(seen)
        self._measured(seen, overlay)
        if overlay.lasso:
            self._painter.setPen(QPen(self._accent, 1.5))
            self._painter.setBrush(Qt.BrushStyle.NoBrush)
            self._painter.drawPolygon(QPolygonF([self._at(*place) for place in overlay.lasso]))

    def _at(self, x: float, y: float) -> QPointF:
        return QPointF((x + 1) / 2 * self._width, (1 - y) / 2 * self._height)

    def _place(self, seen: Rendering, point: NDArray[np.float64]) -> QPointF | None:
        x, y, _ = on_screen(point[None], seen.projection)[0]
        return self._at(float(x), float(y)) if np.isfinite(x) and abs(x) < 10 and abs(y) < 10 else None

    def _text(self, centre: QPointF, text: str) -> None:
        """A text on a plate that keeps it legible on any colour."""
        metrics = QFontMetricsF(self._painter.font())
        plate = QRectF(0, 0, metrics.horizontalAdvance(text) + 8, metrics.height() + 2)
        plate.moveCenter(centre)
        plate.moveLeft(min(max(plate.left(), 2), self._width - plate.width() - 2))
        plate.moveTop(min(max(plate.top(), 2), self._height - plate.height() - 2))
        back = QColor(self._base)
        back.setAlpha(205)
        self._painter.setPen(Qt.PenStyle.NoPen)
        self._painter.setBrush(back)
        self._painter.drawRoundedRect(plate, 3, 3)
        self._painter.setPen(self._ink)
        self._painter.drawText(plate, Qt.AlignmentFlag.AlignCenter, text)

    def _bar(self, seen: Rendering) -> None:
        one = mm_per_px(seen.focus_mm, seen.projection, self._height)
        if not (np.isfinite(one) and one > 0):
            return
        length, size = scale_bar(one, max(BAR_SHARE * self._width, 40))
        y, right = self._height - MARGIN_PX, self._width - MARGIN_PX
        self._painter.setPen(QPen(self._base, 4))
        self._painter.drawLine(QPointF(right - size - 1, y), QPointF(right + 1, y))
        self._painter.setPen(QPen(self._ink, 2))
        self._painter.drawLine(QPointF(right - size, y), QPointF(right, y))
        for x in (right - size, right):
            self._painter.drawLine(QPointF(x, y - 4), QPointF(x, y + 4))
        self._text(QPointF(right - size / 2, y - 14), f"{length:g} mm")

    def _box(self, seen: Rendering, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        """The length of each edge, next to the one of its direction that is lowest on the screen."""
        for axis in range(3):
            others = [other for other in range(3) if other != axis]
            places = []
            for corner in range(4):
                middle = (low + high) / 2
                for bit, other in enumerate(others):
                    middle[other] = (low, high)[corner >> bit & 1][other]
                places.append(self._place(seen, middle))
            known = [place for place in places if place is not None]
            if known:
                lowest = max(known, key=lambda place: (round(place.y()), place.x()))
                self._text(lowest, f"{high[axis] - low[axis]:.1f} mm")

    def _measured(self, seen: Rendering, overlay: Overlay) -> None:
        ends = [self._place(seen, point) for point in overlay.points_mm]
        if overlay.line is not None:
            ends = [self._place(seen, point) for point in overlay.line]
            first, last = ends
            if first is not None and last is not None:
                self._painter.setPen(QPen(self._base, 4))
                self._painter.drawLine(first, last)
                self._painter.setPen(QPen(self._accent, 2))
                self._painter.drawLine(first, last)
        for place in ends:
            if place is not None:
                self._painter.setPen(QPen(self._base, 1.5))
                self._painter.setBrush(self._accent)
                self._painter.drawEllipse(place, 5, 5)
