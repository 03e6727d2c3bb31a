"""Curves over wavelength on a plot of evidence, with their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyqtgraph as pg

from dsl_app.calibrate.evidence.parts import LINE, ChartBox, Floats
from dsl_app.shared.spectrum import Spectrum
from dsl_app.shared.widgets.spectrum_curve import SpectrumCurve
from dsl_core.model.spectral import SpectralCurve

#: 95 % bands.
COVER = 1.96


@dataclass(frozen=True)
class Named:
    """A curve with its name and colour; ``dashed`` for what it is compared with."""

    name: str
    colour: str
    curve: SpectralCurve
    dashed: bool = False


def draw_curves(box: ChartBox, curves: Sequence[Named]) -> list[SpectrumCurve]:
    """Draw curves with 95 % bands over the wavelengths they share, and name them."""
    drawn = []
    for each in curves:
        std = None if each.curve.std is None else np.array(each.curve.std)
        made = SpectrumCurve(box.item, with_band=std is not None)
        made.set_colour(each.colour, dashed=each.dashed)
        made.set_spectrum(Spectrum(np.array(each.curve.wavelengths_nm), np.array(each.curve.values), std))
        drawn.append(made)
    low = min(each.curve.wavelengths_nm[0] for each in curves)
    high = max(each.curve.wavelengths_nm[-1] for each in curves)
    top = max(max(each.curve.values) for each in curves)
    box.item.setXRange(low, high, padding=0.01)
    box.item.setYRange(min(0.0, min(min(each.curve.values) for each in curves)), 1.08 * top, padding=0)
    box.name_curves([(each.name, each.colour, "┅" if each.dashed else LINE) for each in curves])
    return drawn


def draw_points(
    box: ChartBox, x: Floats, y: Floats, std: Floats | None, colour: str, symbol: str = "o", size: int = 7
) -> Any:
    """Points with error bars of 95 % in a colour; returns the points. Those that are NaN are not drawn."""
    known = np.isfinite(np.asarray(y))
    x, y, std = np.asarray(x)[known], np.asarray(y)[known], None if std is None else np.asarray(std)[known]
    if std is not None:
        half = COVER * std
        bars = pg.ErrorBarItem(x=x, y=y, height=2 * half, beam=0.0, pen=colour)
        box.item.addItem(bars)
    points = pg.ScatterPlotItem(x=x, y=y, size=size, symbol=symbol, brush=colour, pen=None)
    box.item.addItem(points)
    return points


def level_line(box: ChartBox, value: float, colour: str, name: str = "") -> Any:
    """A dashed line across the plot, such as a limit."""
    options = {"color": colour, "position": 0.98, "anchors": [(1, 1), (1, 1)]}
    line = pg.InfiniteLine(
        value,
        angle=0,
        movable=False,
        pen=pg.mkPen(colour, width=1, dash=[4, 4]),
        label=name or None,
        labelOpts=options,
    )
    box.item.addItem(line, ignoreBounds=True)
    return line
