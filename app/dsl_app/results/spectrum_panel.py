"""Spectra: under the cursor, of every pin and region, and references."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from dsl_app.results.state import Mark, ResultsState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.spectrum import Pixel, Spectrum
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import ChoiceBox, check_box, label, quiet
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_app.shared.widgets.plots import CalmPlot
from dsl_app.shared.widgets.spectrum_curve import SpectrumCurve
from dsl_core.analysis.transforms import Transform, transformed
from dsl_core.optics.levels import spread_of
from dsl_core.words import capitalised

#: Higher reflectances are errors or gloss; zooming out shows them.
TOP = 1.08
#: Room below and above the values, as a share of the range: the number of the lowest line is not cut.
PADDING = 0.02
#: With more marks than this, bands would cover all spectra: the selected mark alone keeps its own.
MOST_BANDS = 12
#: Width of the axis on the left, and what longer numbers take besides, px.
LEFT_PX, MORE_PX = 48, 18
#: The range that a transform fills at first; reflectance has that of the result.
_RANGES = {
    Transform.NORMALISED: (0.0, 2.5),
    Transform.DERIVATIVE: (-0.01, 0.015),
    Transform.CONTINUUM: (0.0, 1.1),
}


class SpectrumPanel(QWidget):
    """Follows the cursor and marks of a state; dragging the band line changes the band."""

    def __init__(self, state: ResultsState) -> None:
        super().__init__()
        self._state, self._theme, self._top = state, DARK, TOP
        self.plot = CalmPlot(
            "Spectra",
            f"Reflectance with its 95 % band (above {MOST_BANDS} marks, of the selected one), dashed where"
            " the prior decides; regions: mean ± deviation of pixels. Drag the line to change the band.",
            "Reflectance",
            "Wavelength (nm)",
            left_width=LEFT_PX,
        )
        #: Why there will be no curve.
        self.note = label("", "muted", wraps=True)
        self.note.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        top = Qt.AlignmentFlag.AlignTop
        column_of((self.note, 0, top), on=self.plot.viewport(), margins=(60, 12, 12, 12))
        self.item = self.plot.getPlotItem()
        self.item.setYRange(0, 1, padding=PADDING)
        self.band_line = pg.InfiniteLine(angle=90, movable=True)
        self.item.addItem(self.band_line, ignoreBounds=True)
        self.live = SpectrumCurve(self.item)
        self._curves: dict[int, tuple[Mark, SpectrumCurve]] = {}
        self.transform = ChoiceBox(
            "Draw",
            "What is drawn of the spectra; their deviations are carried along",
            [(capitalised(each.value), each) for each in Transform],
            state.transform.set,
        )
        self.stacked = check_box("Offset", "Draw the spectra of marks one above the other")
        self.stacked.clicked.connect(state.stacked.set)
        column_of(
            row_of(self.transform, self.stacked, STRETCH), (self.plot, 1), on=self, margins=0, spacing=2
        )
        self.band_line.sigPositionChanged.connect(self._band_dragged)
        state.result.follow(lambda _: self._new_result())
        follow_any(self._explain, state.result, state.is_begun)
        state.cursor.follow(self._show_cursor)
        state.marks.follow(self._show_marks)
        state.selected.changed.connect(lambda _: self._show_bands())
        state.band.follow(lambda _: self._show_band())
        state.stacked.follow(self.stacked.setChecked)
        for each in (state.transform, state.stacked):
            each.changed.connect(lambda _: self._draw_again())

    def _new_result(self) -> None:
        result = self._state.result.value
        self.live.set_spectrum(None)
        if result is None or not result.has_spectra:
            self._show_band()
            return
        nm = result.wavelengths_nm
        # Old limits would cut the new range.
        self.item.getViewBox().setLimits(xMin=nm[0] - 20, xMax=nm[-1] + 20)
        self.item.setXRange(nm[0], nm[-1], padding=0.02)
        self._top = min(max(1.08 * spread_of(result["reflectance"][::6], 0.5, 99.8)[1], 0.1), TOP)
        self._show_band()
        self._draw_again()

    def _explain(self) -> None:
        self.note.setText(self._state.no_spectra)
        self.note.setVisible(bool(self._state.no_spectra))

    def _show_cursor(self, pixel: Pixel | None) -> None:
        spectrum = None if pixel is None else self._state.spectrum_at(pixel)
        self.live.set_spectrum(None if spectrum is None else self._drawn(spectrum, 0))

    def _drawn(self, spectrum: Spectrum, place: int) -> Spectrum:
        """A spectrum as it is drawn, at a place among those that are stacked."""
        transform, raised = self._state.transform.value, place * self._step
        if transform is Transform.NONE and not raised:
            return spectrum
        mean, std = transformed(spectrum.nm, spectrum.mean, spectrum.std, transform)
        return replace(spectrum, mean=mean + raised, std=std)

    @property
    def _step(self) -> float:
        """By how much each mark is drawn above the one before."""
        high = _RANGES.get(self._state.transform.value, (0.0, self._top))[1]
        return high / 4 if self._state.stacked.value else 0.0

    def _draw_again(self) -> None:
        """Draw all spectra in the chosen transform, and show the range that they fill."""
        transform = self._state.transform.value
        self.transform.choose(transform)
        # Else the axis would claim reflectances that no pixel has.
        raised = f" + {self._step:.2g} a mark" if self._step else ""
        self.item.setLabel("left", capitalised(transform.value) + raised)
        self.item.getAxis("left").setWidth(LEFT_PX + (MORE_PX if transform is Transform.DERIVATIVE else 0))
        for _, curve in self._curves.values():
            curve.remove()
        self._curves.clear()
        self._show_marks(self._state.marks.value)
        self._show_cursor(self._state.cursor.value)
        low, high = _RANGES.get(transform, (0.0, self._top))
        high += len(self._curves) * self._step
        # Old limits would cut the new range here, too.
        self.item.getViewBox().setLimits(yMin=min(-0.5, 4 * low), yMax=max(3.0, 4 * high))
        self.item.setYRange(low, high, padding=PADDING)

    def _show_band(self) -> None:
        result = self._state.result.value
        self.band_line.setVisible(result is not None and result.has_spectra)
        if result is not None and result.has_spectra:
            with quiet(self.band_line):
                self.band_line.setPos(result.wavelengths_nm[self._state.band.value])

    def _band_dragged(self) -> None:
        result = self._state.result.value
        if result is not None and result.has_spectra:
            nm = result.wavelengths_nm
            self._state.band.set(int(abs(nm - self.band_line.value()).argmin()))
            self._show_band()

    def _show_marks(self, marks: tuple[Mark, ...]) -> None:
        by_key = {mark.key: mark for mark in marks}
        for key, (mark, curve) in list(self._curves.items()):
            if by_key.get(key) is not mark:
                curve.remove()
                del self._curves[key]
        for key, mark in by_key.items():
            if key not in self._curves and mark.shown and not mark.trouble:
                curve = SpectrumCurve(self.item, with_band=mark.kind != "reference")
                self._colour(curve, mark)
                curve.set_spectrum(self._drawn(mark.spectrum, len(self._curves) + 1))
                self._curves[key] = (mark, curve)
        self._show_bands()

    def _show_bands(self) -> None:
        are_few, selected = len(self._curves) <= MOST_BANDS, self._state.selected.value
        for key, (_, curve) in self._curves.items():
            curve.show_band(are_few or key == selected)

    def _colour(self, curve: SpectrumCurve, mark: Mark) -> None:
        colour = self._theme.pin(mark.colour)
        curve.set_colour(colour, dashed=mark.kind == "reference")

    @property
    def named_curves(self) -> tuple[tuple[Any, str], ...]:
        """The curves shown for marks, each with its name."""
        return tuple((curve.solid, mark.name) for mark, curve in self._curves.values())

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        self.plot.apply_theme(theme)
        self.band_line.setPen(pg.mkPen(theme.accent, width=1, style=Qt.PenStyle.DashLine))
        self.band_line.setHoverPen(pg.mkPen(theme.accent, width=3))
        self.live.set_colour(theme.text, width=2)
        for mark, curve in self._curves.values():
            self._colour(curve, mark)
