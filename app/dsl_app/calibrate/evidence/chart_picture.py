"""The picture of a chart with its patches outlined and four corners to drag."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from dsl_app.shared.theme import DARK, Theme

Floats = NDArray[np.float64]
#: Rows and columns of patches; half width of what is measured of a patch, in distances between patches.
ROWS, COLUMNS, INNER = 4, 6, 0.28
CORNER_NAMES = ("dark skin", "bluish green", "black", "white")
_GRID = np.array([[0, 0], [COLUMNS, 0], [COLUMNS, ROWS], [0, ROWS]], float)
_ARROWS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Up: (0, -1),
    Qt.Key.Key_Down: (0, 1),
}


def patch_outlines(corners_px: Floats) -> Floats:
    """Corners (24, 4, 2) of the measured part of each patch, by the homography of the four outer corners."""
    rows = []
    for (u, v), (x, y) in zip(_GRID, corners_px, strict=True):
        rows.append([u, v, 1, 0, 0, 0, -u * x, -v * x])
        rows.append([0, 0, 0, u, v, 1, -u * y, -v * y])
    matrix = np.append(np.linalg.solve(np.array(rows), np.ravel(corners_px)), 1.0).reshape(3, 3)
    square = INNER * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    centres = np.array([[i % COLUMNS + 0.5, i // COLUMNS + 0.5] for i in range(ROWS * COLUMNS)])
    points = (centres[:, None] + square).reshape(-1, 2)
    lifted = np.concatenate([points, np.ones((len(points), 1))], 1) @ matrix.T
    return np.asarray(lifted[:, :2] / lifted[:, 2:]).reshape(-1, 4, 2)


def corners_in(shape: tuple[int, ...]) -> Floats:
    """Corners in the middle of a picture (rows, columns, ...), for a person to drag to where they belong."""
    height, width = shape[:2]
    side = min(0.7 * width / COLUMNS, 0.7 * height / ROWS)
    return (_GRID - (COLUMNS / 2, ROWS / 2)) * side + ((width - 1) / 2, (height - 1) / 2)


class ChartPicture(QWidget):
    """Emits ``moved`` while a corner is dragged or moved by arrow keys; Tab goes to the next corner."""

    moved = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._theme, self._chosen = DARK, 0
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Chart with its corners")
        tip = "Drag the corners of the patches, or choose one by 1 to 4 and move it by arrows (Shift: ten)."
        self.setToolTip(tip)
        self.canvas = pg.GraphicsLayoutWidget()
        self.canvas.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.box = self.canvas.addViewBox(lockAspect=True, invertY=True, enableMenu=False)
        self.image = pg.ImageItem(axisOrder="row-major")
        # White on black, so that the outlines are seen on every patch.
        self.shadow, self.outlines = (pg.PlotCurveItem(connect="finite") for _ in range(2))
        self.corners = [pg.TargetItem(size=14, movable=True) for _ in CORNER_NAMES]
        for item in (self.image, self.shadow, self.outlines, *self.corners):
            self.box.addItem(item, ignoreBounds=item is not self.image)
        for corner in self.corners:
            corner.setZValue(10)
            corner.sigPositionChanged.connect(self._moved)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.canvas)

    @property
    def corners_px(self) -> Floats:
        """Column and row of the corners, (4, 2)."""
        return np.array([[corner.pos().x(), corner.pos().y()] for corner in self.corners])

    def show_corners(self, corners_px: Floats) -> None:
        """Put the corners somewhere, which moves nobody to anything."""
        for corner, (x, y) in zip(self.corners, corners_px, strict=True):
            corner.blockSignals(True)
            corner.setPos(float(x), float(y))
            corner.blockSignals(False)
        self._outline()

    def show_picture(self, picture: NDArray[np.uint8]) -> None:
        """Show a picture, RGB; pixels have their centres at whole numbers."""
        self.image.setImage(picture, levels=(0, 255), autoLevels=False)
        height, width = picture.shape[:2]
        self.image.setRect(-0.5, -0.5, width, height)
        self.box.autoRange(padding=0.02, items=[self.image])

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """1 to 4 choose a corner, arrows move it."""
        key = Qt.Key(event.key())
        if Qt.Key.Key_1 <= key <= Qt.Key.Key_4:
            self._chosen = int(key) - int(Qt.Key.Key_1)
            self._paint_corners()
        elif key in _ARROWS:
            step = 10 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1
            dx, dy = _ARROWS[key]
            corner = self.corners[self._chosen]
            corner.setPos(corner.pos().x() + step * dx, corner.pos().y() + step * dy)
        else:
            super().keyPressEvent(event)

    def _moved(self, *_: Any) -> None:
        self._outline()
        self.moved.emit()

    def _outline(self) -> None:
        try:
            outlines = patch_outlines(self.corners_px)
        except np.linalg.LinAlgError:
            # Three corners on a line: nothing to outline until they are moved apart.
            outlines = np.full((1, 4, 2), np.nan)
        closed = np.concatenate([outlines, outlines[:, :1], np.full((len(outlines), 1, 2), np.nan)], 1)
        for item in (self.shadow, self.outlines):
            item.setData(*closed.reshape(-1, 2).T)

    def _paint_corners(self) -> None:
        for index, corner in enumerate(self.corners):
            colour = self._theme.warn if index == self._chosen else self._theme.accent
            corner.setPen(pg.mkPen(colour, width=2))
            corner.setHoverPen(pg.mkPen(self._theme.bad, width=2))

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.canvas.setBackground(theme.base)
        self.shadow.setPen(pg.mkPen("#000000", width=3))
        self.outlines.setPen(pg.mkPen("#ffffff", width=1))
        self._paint_corners()
