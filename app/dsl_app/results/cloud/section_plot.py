"""The curve of a section: height above the line between two points, with its 95 % band."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QSize
from PySide6.QtGui import QColor, QResizeEvent

from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.plots import CalmPlot
from dsl_core.evaluation.shape import Section
from dsl_core.solve.normal import BAND_95

#: Height of the plot, in a low window, and from which on its axis has room for words, px.
HEIGHT_PX, LEAST_PX, SPOKEN_PX = 150, 90, 130
HEIGHT, UNIT = "Height (mm)", "mm"


class SectionPlot(CalmPlot):
    """Shows a section."""

    def __init__(self) -> None:
        tip = "Height of the surface above the straight line between the two points, towards the camera"
        super().__init__("Section", tip, HEIGHT, "Along the line (mm)")
        self.setMinimumHeight(LEAST_PX)
        self.setMaximumHeight(HEIGHT_PX)
        item = self.getPlotItem()
        self._low, self._high = (pg.PlotCurveItem(pen=pg.mkPen(None)) for _ in range(2))
        self._band = pg.FillBetweenItem(self._low, self._high)
        self.curve = pg.PlotCurveItem(connect="finite")
        for each in (self._low, self._high, self._band, self.curve):
            item.addItem(each)
        self.apply_theme(DARK)

    def sizeHint(self) -> QSize:
        """As high as it may be."""
        return QSize(super().sizeHint().width(), HEIGHT_PX)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Leave the unit alone at an axis that is too short for words."""
        super().resizeEvent(event)
        item = self.getPlotItem()
        # pyqtgraph sets a size before it has axes.
        if item is not None:
            item.setLabel("left", HEIGHT if self.height() >= SPOKEN_PX else UNIT)

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        super().apply_theme(theme)
        self.curve.setPen(pg.mkPen(theme.accent, width=1.6))
        fill = QColor(theme.accent)
        fill.setAlpha(56)
        self._band.setBrush(fill)

    def show_section(self, cut: Section) -> None:
        """Show the curve of a section."""
        known = np.isfinite(cut.height_mm)
        spread = BAND_95 * np.where(np.isfinite(cut.std_mm), cut.std_mm, 0.0)
        self.curve.setData(cut.along_mm, cut.height_mm)
        for side, limit in ((-1, self._low), (1, self._high)):
            limit.setData(cut.along_mm[known], (cut.height_mm + side * spread)[known])
