"""One spectrum in a plot: line, 95 % band, and dashes where the prior and not the data decides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QGraphicsItem

from dsl_app.shared.spectrum import Spectrum
from dsl_core.evaluation.uncertainty import DECIDED_FROM

Floats = NDArray[np.floating[Any]]
#: To either side of a single band, its value is drawn so far, nm.
SINGLE_NM = 4.0


def split_by_share(mean: Floats, share: Floats | None) -> tuple[Floats, Floats]:
    """The values where data decide and those where the prior does, NaN elsewhere.

    The dashed part reaches one band into the solid one, so that the curve has no gaps.
    """
    values = np.asarray(mean, np.float64)
    if share is None:
        return values, np.full_like(values, np.nan)
    decided = ~(np.asarray(share) < DECIDED_FROM)
    undecided = ~decided
    undecided[1:] |= ~decided[:-1]
    undecided[:-1] |= ~decided[1:]
    return np.where(decided, values, np.nan), np.where(undecided, values, np.nan)


def _widened(spectrum: Spectrum) -> Spectrum:
    """A spectrum of one band as a level line, as a curve through one point draws nothing."""
    std, share = (None if each is None else np.repeat(each, 2) for each in (spectrum.std, spectrum.share))
    nm = spectrum.nm[0] + np.array([-SINGLE_NM, SINGLE_NM])
    return Spectrum(nm, np.repeat(spectrum.mean, 2), std, share, spectrum.sigmas)


class SpectrumCurve:
    """Items of one spectrum on a plot item; give it another with `set_spectrum`."""

    def __init__(self, plot: pg.PlotItem, with_band: bool = True) -> None:
        self._plot = plot
        self.solid, self.dashed = pg.PlotCurveItem(connect="finite"), pg.PlotCurveItem(connect="finite")
        self._items = [self.solid, self.dashed]
        self.band: pg.FillBetweenItem | None = None
        if with_band:
            # Limits without a pen must be curve items: a fill between others draws nothing.
            self._low, self._high = (pg.PlotCurveItem(pen=pg.mkPen(None)) for _ in range(2))
            for limit in (self._low, self._high):
                limit.setFlag(QGraphicsItem.GraphicsItemFlag.ItemHasNoContents)
            self.band = pg.FillBetweenItem(self._low, self._high)
            self._items = [self._low, self._high, self.band, *self._items]
        for item in self._items:
            plot.addItem(item)
        self._shows_band = self._has_band = True

    def set_colour(self, colour: str, width: float = 1.6, dashed: bool = False) -> None:
        """Draw in a colour (``#rrggbb``); ``dashed`` throughout, as references are."""
        style = Qt.PenStyle.DotLine if dashed else Qt.PenStyle.SolidLine
        self.solid.setPen(pg.mkPen(colour, width=width, style=style))
        self.dashed.setPen(pg.mkPen(colour, width=width, style=Qt.PenStyle.DashLine))
        if self.band is not None:
            fill = QColor(colour)
            fill.setAlpha(56)
            self.band.setBrush(pg.mkBrush(fill))

    def set_spectrum(self, spectrum: Spectrum | None) -> None:
        """Show a spectrum; nothing for None."""
        for item in self._items:
            item.setVisible(spectrum is not None)
        if spectrum is None:
            return
        if len(spectrum.nm) == 1:
            spectrum = _widened(spectrum)
        solid, dashed = split_by_share(spectrum.mean, spectrum.share)
        self.solid.setData(spectrum.nm, solid)
        self.dashed.setData(spectrum.nm, dashed)
        # A path without points is not a valid drawing in a figure.
        self.dashed.setVisible(bool(np.isfinite(dashed).any()))
        if self.band is None:
            return
        self._has_band = spectrum.std is not None
        self.show_band(self._shows_band)
        if spectrum.std is not None:
            half = np.nan_to_num(spectrum.sigmas * spectrum.std)
            mean = np.nan_to_num(spectrum.mean)
            self._low.setData(spectrum.nm, mean - half)
            self._high.setData(spectrum.nm, mean + half)

    def show_band(self, on: bool) -> None:
        """Show the band of a spectrum that has one, or hide it."""
        self._shows_band = on
        if self.band is not None:
            self.band.setVisible(on and self._has_band)

    def remove(self) -> None:
        """Leave the plot."""
        for item in self._items:
            self._plot.removeItem(item)
