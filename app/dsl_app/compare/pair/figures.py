"""Numbers of a comparison: both spectra under the cursor, and figures of all of A against B."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSplitter

from dsl_app.compare.pair.state import CompareState, Pair
from dsl_app.shared.spectrum import spectrum_of_pixel
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.plots import calm_plot, theme_plots
from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from dsl_app.shared.widgets.spectrum_curve import SpectrumCurve

#: Room for most names of figures; longer ones break.
TABLE_PX = 400


class CompareFigures(QSplitter):
    """Follows the pair and the cursor of a `CompareState`."""

    def __init__(self, state: CompareState) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self._state = state
        self.plot = calm_plot(
            "Spectra of A and B", "Reflectance under the cursor: A solid with its 95 % band, B dotted",
            "Reflectance", "Wavelength (nm)",
        )  # fmt: skip
        self.plot.setXRange(430, 660, padding=0.02)
        self.plot.setYRange(0, 1, padding=0.02)
        self.curves = [SpectrumCurve(self.plot.getPlotItem(), with_band=i == 0) for i in range(2)]
        self.table = ReadTable(
            "Figures of the comparison", "Differences are A minus B", ("Figure", "Value", "Unit")
        )
        self.table.setMinimumWidth(TABLE_PX)
        self.table.wrap(0)
        set_help(self.table, "comparing#figures")
        self.setChildrenCollapsible(False)
        self.addWidget(self.plot)
        self.addWidget(self.table)
        self.setStretchFactor(0, 1)
        self.stops: list[Callable[[], None]] = [
            state.pair.follow(self._show_pair),
            state.cursor.follow(lambda _: self._show_cursor()),
        ]

    def _show_pair(self, pair: Pair | None) -> None:
        rows = () if pair is None else pair.rows
        self.table.show_rows(
            [
                (cell(row.figure), cell(row.words.replace("-", "−"), side=RIGHT), cell(row.unit))
                for row in rows
            ]
        )
        self._show_cursor()

    def _show_cursor(self) -> None:
        pair, pixel = self._state.pair.value, self._state.cursor.value
        for i, curve in enumerate(self.curves):
            side = None if pair is None else (pair.first, pair.second)[i]
            curve.set_spectrum(
                None if side is None or pixel is None else spectrum_of_pixel(side.arrays, pixel)
            )

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        theme_plots((self.plot,), theme)
        self.curves[0].set_colour(theme.pins[0], width=2)
        self.curves[1].set_colour(theme.pins[1], width=2, dashed=True)
