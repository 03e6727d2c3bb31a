"""How far the pixels of the selected result are off their plane, and the region that counts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QWidget

from dsl_app.compare.series.controller import SeriesController
from dsl_app.compare.series.state import SeriesState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import label, push_button, quiet
from dsl_app.shared.widgets.layouts import column_of, row_of
from dsl_app.shared.widgets.pictures import DIFFERENCE, PictureView, RegionBox, colour_map
from dsl_app.shared.widgets.plots import theme_bar
from dsl_core.optics.levels import spread_of


class SeriesPicture(QWidget):
    """Follows a `SeriesState`; dragging the rectangle sets the region."""

    def __init__(self, state: SeriesState, control: SeriesController) -> None:
        super().__init__()
        self._state, self._control = state, control
        self.title = label("", "heading")
        self.part = push_button(
            "Re&gion", "Use only the pixels in a rectangle, which you can drag on the picture", self._switch
        )
        self.part.setCheckable(True)
        self.canvas = PictureView(
            "Residuals of the plane",
            "How far each pixel is behind (red) or in front of (blue) the plane of the target; blank where"
            " it is not counted.",
        )
        self.box, self.image = self.canvas.box, self.canvas.image
        self.bar = pg.ColorBarItem(interactive=False, width=14, colorMap=colour_map(DIFFERENCE))
        self.rectangle = RegionBox(1)
        self.rectangle.hide()
        self._lay_out()
        self.rectangle.sigRegionChangeFinished.connect(self._dragged)
        self.stops = follow_any(self.show_row, state.rows, state.selected, state.region)

    def _lay_out(self) -> None:
        self.canvas.addItem(self.bar, 0, 1)
        self.box.addItem(self.rectangle, ignoreBounds=True)
        head = row_of((self.title, 1), self.part)
        column_of(head, (self.canvas, 1), on=self, margins=0, spacing=2)

    @property
    def _shape(self) -> tuple[int, int] | None:
        row = self._state.selected_row
        return None if row is None or row.target is None else row.target.shape

    def show_row(self) -> None:
        """Show the selected row."""
        row, region = self._state.selected_row, self._state.region.value
        target = None if row is None else row.target
        self.part.setChecked(region is not None)
        self.part.setEnabled(target is not None or region is not None)
        self.rectangle.setVisible(region is not None)
        self.bar.setVisible(target is not None)
        if row is None or target is None:
            self.image.clear()
            self.title.setText("Select a row to see its plane." if row is None else f"{row.name}: no plane")
            return
        self.title.setText(f"{row.name}: off its plane (mm)")
        reach = max(spread_of(np.abs(target.residual_mm), 0, 99)[1], 1e-6)
        self.bar.setLevels((-reach, reach))
        table = colour_map(DIFFERENCE).getLookupTable(nPts=256)
        self.image.setImage(target.residual_mm, levels=(-reach, reach), lut=table, autoLevels=False)
        height, width = target.shape
        self.image.setRect(0, 0, width, height)
        if region is not None:
            self._place(region)

    def _place(self, region: tuple[int, int, int, int]) -> None:
        with quiet(self.rectangle):
            self.rectangle.setPos(region[0], region[1])
            self.rectangle.setSize((region[2], region[3]))

    def _switch(self, wanted: bool) -> None:
        shape = self._shape
        if wanted and shape is not None:
            with quiet(self.rectangle):
                self.rectangle.put_in_middle(shape[1], shape[0])
            self._control.set_region(self.rectangle.region(shape[1], shape[0]))
        else:
            self._control.set_region(None)

    def _dragged(self, _: Any) -> None:
        shape = self._shape
        if shape is not None and self.rectangle.isVisible():
            self._control.set_region(self.rectangle.region(shape[1], shape[0]))

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self.canvas.apply_theme(theme)
        self.rectangle.apply_theme(theme)
        theme_bar(self.bar, theme)
