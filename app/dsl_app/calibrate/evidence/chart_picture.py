"""A chart as the camera saw it, with corners to drag, and its patches as measured and as expected."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QFontMetricsF, QHelpEvent, QKeyEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QToolTip, QWidget

from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import quiet
from dsl_app.shared.widgets.hints import FocusRing
from dsl_app.shared.widgets.layouts import column_of
from dsl_app.shared.widgets.pictures import PictureView, arrow_step
from dsl_core.calibration.colour.patches import INNER, apply_homography, grid_corners
from dsl_core.optics.charts import CHART_SHAPE

Floats = NDArray[np.float64]
ROWS, COLUMNS = CHART_SHAPE
#: Room between patches, px.
GAP = 4.0


def patch_outlines(corners_px: Floats) -> Floats:
    """Corners (24, 4, 2) of the measured part of each patch; raises `LinAlgError` for corners on a line.

    The homography of the four outer corners is solved here, because it is needed at every move of the mouse.
    """
    rows = []
    for (u, v), (x, y) in zip(grid_corners(), corners_px, strict=True):
        rows.append([u, v, 1, 0, 0, 0, -u * x, -v * x])
        rows.append([0, 0, 0, u, v, 1, -u * y, -v * y])
    matrix = np.append(np.linalg.solve(np.array(rows), np.ravel(corners_px)), 1.0).reshape(3, 3)
    square = INNER * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    centres = np.array([[i % COLUMNS + 0.5, i // COLUMNS + 0.5] for i in range(ROWS * COLUMNS)])
    return apply_homography(matrix, (centres[:, None] + square).reshape(-1, 2)).reshape(-1, 4, 2)


def corners_in(shape: tuple[int, ...]) -> Floats:
    """Corners in the middle of a picture (rows, columns, ...), for a person to drag to where they belong."""
    height, width = shape[:2]
    side = min(0.7 * width / COLUMNS, 0.7 * height / ROWS)
    return (grid_corners() - (COLUMNS / 2, ROWS / 2)) * side + ((width - 1) / 2, (height - 1) / 2)


class ChartPicture(QWidget):
    """The picture of a chart with its patches outlined and four corners to drag.

    Emits ``moved`` while a corner is dragged or moved by arrow keys; 1 to 4 choose a corner.
    """

    moved = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._theme, self._chosen = DARK, 0
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Chart with its corners")
        tip = "Drag the corners, or choose one with 1 to 4 and move it with the arrow keys (Shift: by 10 px)."
        self.setToolTip(plain_tip(tip))
        self.canvas = PictureView("")
        self.canvas.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        FocusRing(self, self.canvas)
        self.box, self.image = self.canvas.box, self.canvas.image
        # White on black, so that the outlines are seen on every patch.
        self.shadow, self.outlines = (
            pg.PlotCurveItem(connect="finite", pen=pg.mkPen(colour, width=width))
            for colour, width in (("#000000", 3), ("#ffffff", 1))
        )
        self.corners = [pg.TargetItem(size=14, movable=True) for _ in grid_corners()]
        for item in (self.shadow, self.outlines, *self.corners):
            self.box.addItem(item, ignoreBounds=True)
        for corner in self.corners:
            corner.setZValue(10)
            corner.sigPositionChanged.connect(self._moved)
        column_of(self.canvas, on=self, margins=0)

    @property
    def corners_px(self) -> Floats:
        """Column and row of the corners, (4, 2)."""
        return np.array([[corner.pos().x(), corner.pos().y()] for corner in self.corners])

    def show_corners(self, corners_px: Floats) -> None:
        """Put the corners somewhere without telling that they moved."""
        for corner, (x, y) in zip(self.corners, corners_px, strict=True):
            with quiet(corner):
                corner.setPos(float(x), float(y))
        self._outline()

    def show_picture(self, picture: NDArray[np.uint8]) -> None:
        """Show a picture, RGB (rows, columns, 3); pixels have their centres at whole numbers."""
        self.image.setImage(picture, levels=(0, 255), autoLevels=False)
        height, width = picture.shape[:2]
        self.image.setRect(-0.5, -0.5, width, height)
        self.canvas.fit(padding=0.02)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """1 to 4 choose a corner, arrows move it."""
        key, step = Qt.Key(event.key()), arrow_step(event)
        if Qt.Key.Key_1 <= key <= Qt.Key.Key_4:
            self._chosen = int(key) - int(Qt.Key.Key_1)
            self._paint_corners()
        elif step is not None:
            corner = self.corners[self._chosen]
            corner.setPos(corner.pos().x() + step[0], corner.pos().y() + step[1])
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
        self.canvas.apply_theme(theme)
        self._paint_corners()


def screen_colours(share: Floats) -> list[QColor]:
    """Screen colours of signals over white (n, 3), in the camera's red, green and blue."""
    encoded = np.clip(share, 0, 1) ** (1 / 2.2)
    return [QColor.fromRgbF(*map(float, row)) for row in encoded]


class Swatches(QWidget):
    """The 24 patches as split squares, in reading order: left as measured, right as expected.

    The number below each is its held-out residual, % of white.
    """

    def __init__(self) -> None:
        super().__init__()
        self._theme = DARK
        self.measured: list[QColor] = []
        self.expected: list[QColor] = []
        self._names: list[str] = []
        self._held_out: list[float] = []
        self._sentence = "Reading the picture…"
        self.setMinimumSize(220, 150)
        self.setAccessibleName("Patches as measured and as expected")

    def show_colours(
        self, measured: Floats, expected: Floats, held_out: Sequence[float], names: Sequence[str]
    ) -> None:
        """Show signals over white, (24, 3), and residuals as a share of white."""
        self.measured, self.expected = screen_colours(measured), screen_colours(expected)
        self._held_out, self._names = list(held_out), list(names)
        worst = int(np.argmax(held_out))
        self.setAccessibleDescription(
            f"{names[worst]} differs most from what is expected, by {100 * held_out[worst]:.1f} % of white."
        )
        self.update()

    def clear(self, sentence: str) -> None:
        """Show a sentence instead of patches."""
        self.measured, self.expected, self._names, self._held_out = [], [], [], []
        self._sentence = sentence
        self.setAccessibleDescription(sentence)
        self.update()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.update()

    def _place(self, index: int) -> QRectF:
        """Where a patch is drawn, with room for its number."""
        width, height = self.width() / COLUMNS, self.height() / ROWS
        return QRectF(index % COLUMNS * width, index // COLUMNS * height, width - GAP, height - GAP)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw all patches."""
        painter = QPainter(self)
        line = QFontMetricsF(self.font()).height()
        if not self.measured:
            painter.setPen(QColor(self._theme.muted))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignTop, self._sentence)
            return
        for index, (measured, expected) in enumerate(zip(self.measured, self.expected, strict=True)):
            place = self._place(index)
            square = place.adjusted(0, 0, 0, -line)
            middle = square.center().x()
            painter.fillRect(
                QRectF(square.left(), square.top(), middle - square.left(), square.height()), measured
            )
            painter.fillRect(QRectF(middle, square.top(), square.right() - middle, square.height()), expected)
            painter.setPen(QPen(QColor(self._theme.line), 1))
            painter.drawRect(square)
            painter.setPen(QColor(self._theme.muted))
            below = QRectF(place.left(), square.bottom(), place.width(), line)
            painter.drawText(below, Qt.AlignmentFlag.AlignHCenter, f"{100 * self._held_out[index]:.2f}")

    def event(self, event: QEvent) -> bool:
        """Show the name of the patch under the mouse."""
        if isinstance(event, QHelpEvent) and self._names:
            inside = [i for i in range(len(self._names)) if self._place(i).contains(event.pos().toPointF())]
            words = (
                f"{self._names[inside[0]]}: held out {100 * self._held_out[inside[0]]:.2f} %"
                if inside
                else ""
            )
            QToolTip.showText(
                event.globalPos(),
                plain_tip(f"{words}. Left measured, right expected." if words else ""),
                self,
            )
            return True
        return super().event(event)
