"""The histogram of a camera's raw counts."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.plots import colour_legend
from dsl_core.capture.preview import BINS

_NAMES = ("red", "green", "blue")
_COLOURS = ("#d94545", "#3fa34d", "#3f7fd9")
_GREY = "#8c8c8c"


class CountsHistogram(pg.PlotWidget):  # type: ignore[misc]
    """Pixels over counts (DN), a curve for each colour; nothing in it can be moved."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setMouseEnabled(False, False)
        self.hideButtons()
        self.setMenuEnabled(False)
        self.setAccessibleName("Histogram of raw counts")
        # No key does anything with it.
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setLabel("bottom", "raw counts, DN")
        # Room for half of the outermost numbers of the axes.
        self.getPlotItem().setContentsMargins(0, 8, 14, 0)
        self.legend = self.addLegend(offset=(-4, 1), colCount=3, verSpacing=-6)
        self.curves = [
            self.plot(pen=pg.mkPen(colour, width=1), name=name)
            for colour, name in zip(_COLOURS, _NAMES, strict=True)
        ]

        #: Of a camera without colours; it has no name, as it is alone.
        self.grey = self.plot(pen=pg.mkPen(_GREY, width=1))

    def show_counts(
        self, counts: NDArray[np.int64] | None, levels: int, is_logarithmic: bool = False
    ) -> None:
        """Show pixels of a camera with so many levels; None clears what was shown.

        ``counts`` are (3, `BINS`), or (1, `BINS`) of a camera without colours.
        """
        self.setXRange(0, levels, padding=0)
        positions = (np.arange(BINS) + 0.5) * levels / BINS
        is_grey = counts is not None and len(counts) == 1
        self.legend.setVisible(not is_grey)
        for curve in (*self.curves, self.grey):
            curve.setData([], [])
        if counts is not None:
            heights = np.log10(counts + 1) if is_logarithmic else counts
            for curve, height in zip([self.grey] if is_grey else self.curves, heights, strict=True):
                curve.setData(positions, height)
        self.setLabel("left", "log₁₀ pixels" if is_logarithmic else "pixels")

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self.setBackground(theme.base)
        for side in ("left", "bottom"):
            axis = self.getAxis(side)
            axis.setPen(theme.line)
            axis.setTextPen(theme.muted)
        colour_legend(self.legend, theme.muted)
