"""Colours of the marks under a light, and their differences to the selected one."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import chain, count

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication, QShowEvent
from PySide6.QtWidgets import QWidget

from dsl_app.results.state import Mark, ResultsState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import ChoiceBox, label, push_button
from dsl_app.shared.widgets.icons import swatch
from dsl_app.shared.widgets.layouts import column_of, row_of
from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from dsl_core.analysis.colours import HEADER, ILLUMINANTS, Colour, colours_of, lights_for
from dsl_core.errors import CalibrationError, DecodeError
from dsl_core.model.figure import with_std

EMPTY = "Pin pixels, mark regions or add references; their colours under a light are listed here."
THIN = chr(0x200A)
_CHOSEN = "Differences are CIEDE2000 to {}, which is selected among the marks; ± is one deviation."
_NONE = "Select a mark to see differences to it; ± is one deviation."


class ColoursPanel(QWidget):
    """Follows the marks of a state; computes only while it is seen."""

    def __init__(self, state: ResultsState) -> None:
        super().__init__()
        self._state, self._theme = state, DARK
        lights = [(text, key) for key, text in ILLUMINANTS.items()]
        self.light = ChoiceBox("Light", "The light source that colours are computed for", lights)
        self.light.be_narrow(140)
        self.copy = push_button("Copy", "Copy the colours under all lights for a spreadsheet", self.copy_all)
        self.table = ReadTable(
            "Colours", "CIELAB relative to the perfect diffuser", ("Mark", "L*", "a*", "b*", "ΔE00")
        )
        self.table.widen(0)
        self.table.be_dense(padding_px=0)
        self.text = label(EMPTY, "muted", wraps=True)
        self.text.setAlignment(Qt.AlignmentFlag.AlignTop)
        column_of(
            row_of(label("Light"), (self.light, 1), self.copy), (self.table, 1), self.text,
            on=self, margins=0,
        )  # fmt: skip
        self.light.currentIndexChanged.connect(lambda _: self._show())
        follow_any(self._show, state.marks, state.selected, state.result)

    def showEvent(self, event: QShowEvent) -> None:
        """Compute what changed while the tab was hidden."""
        super().showEvent(event)
        self._show()

    def _show(self) -> None:
        if not self.isVisible():
            return
        marks = _labelled(self._state.marks.value)
        selected = self._state.selected_mark
        reference = next((label for label, mark in marks.items() if mark is selected), None)
        why = EMPTY
        try:
            found = self._colours(marks, str(self.light.currentData()), reference)
        except DecodeError as error:
            found, why = [], str(error)
        self.copy.setEnabled(bool(found))
        self.table.setVisible(bool(found))
        if not found:
            self.text.setText(why)
            return
        self.text.setText(_NONE if reference is None else _CHOSEN.format(reference))
        rows = []
        for each in found:
            first = cell(each.name)
            first.setIcon(swatch(self._theme.pin(marks[each.name].colour)))
            texts = [_value(v, s) for v, s in zip(each.lab, each.lab_std, strict=True)]
            texts.append("" if each.delta_e is None else _value(each.delta_e, each.delta_e_std))
            rows.append((first, *(cell(text, "", RIGHT) for text in texts)))
        self.table.show_rows(rows)

    def _colours(self, marks: dict[str, Mark], light: str, reference: str | None) -> list[Colour]:
        result = self._state.result.value
        if result is None or not result.has_spectra:
            return []
        bands, spectra = result.wavelengths_nm, {}
        for name, mark in marks.items():
            spectrum = mark.spectrum
            mean, std = spectrum.mean, mark.band_std
            if mark.curve is not None:
                try:
                    at = result.at_bands(mark.curve)
                except CalibrationError:
                    continue
                mean, std = at.values, None if mark.curve.std is None else at.std
            known = np.isfinite(mean)
            # Bands that are missing lie between others, if enough are left for a colour.
            if len(mean) == len(bands) and (known.all() or light in lights_for(bands[known])):
                unknown = np.full(len(bands), np.nan)
                spectra[name] = np.asarray(mean, float), unknown if std is None else np.asarray(std, float)
        known_reference = reference if reference in spectra else None
        together = self._state.band_correlation(result)
        return colours_of(spectra, bands, (light,), known_reference, together)

    def copy_all(self) -> None:
        """Copy the colours under all lights."""
        marks = _labelled(self._state.marks.value)
        selected = self._state.selected_mark
        reference = next((label for label, mark in marks.items() if mark is selected), None)
        result = self._state.result.value
        lights = () if result is None else lights_for(np.asarray(result.wavelengths_nm, np.float64))
        found = [each for light in lights for each in self._colours(marks, light, reference)]
        lines = ["\t".join(HEADER)]
        for each in found:
            cells = (f"{v:.4f}" if isinstance(v, float) else v or "" for v in each.cells)
            lines.append("\t".join(cells))
        QGuiApplication.clipboard().setText("\n".join(lines))

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        self.table.apply_theme(theme)
        self._show()


def _labelled(marks: Iterable[Mark]) -> dict[str, Mark]:
    """Marks that have a spectrum by what they are called in the table: those of one name are numbered."""
    found: dict[str, Mark] = {}
    for mark in marks:
        if not mark.trouble:
            labels = chain([mark.name], (f"{mark.name} ({number})" for number in count(2)))
            found[next(label for label in labels if label not in found)] = mark
    return found


def _value(value: float, std: float | None) -> str:
    """A figure to the second digit of its deviation, two places at most; without one if it is not known."""
    if std is None or math.isnan(std):
        return f"{value:.2f}".replace("-", "−")
    # Thin spaces: five columns have to fit next to the picture.
    return with_std(value, std, 2).replace(" ± ", f"{THIN}±{THIN}").replace("-", "−")
