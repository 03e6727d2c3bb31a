"""Evidence of the Spectralon: emission of the LEDs, how evenly the camera sees, and the white signals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyqtgraph as pg

from dsl_app.calibrate.evidence.base import Evidence, side_by_side, stacked
from dsl_app.calibrate.evidence.charts import CHANNELS, ChartBox, channel_curves, draw_curves, like_a_picture
from dsl_app.calibrate.evidence.tables import Cell, NumberTable, with_spread
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.layouts import boxed, column_of
from dsl_app.shared.widgets.plots import theme_bar
from dsl_core.model.calibration.spectralon import SpectralonCalibration

HEADS = (
    ("Channel", "Channel of the camera"),
    *(
        (f"{name.capitalize()} LED", f"Signal under {name} at full drive, with its deviation")
        for name in CHANNELS
    ),
    (
        "White / sum",
        "Signal under white over the sum of those under red, green and blue: 1 if the light is additive",
    ),
)


class SpectralonEvidence(Evidence[SpectralonCalibration]):
    """Emission with its bands next to the flat field, the signals of white below."""

    def __init__(self) -> None:
        super().__init__(SpectralonCalibration)
        self.emission = ChartBox(
            "Emission of the LEDs",
            "Relative spectral radiance of each LED at full drive with its 95 % band.",
            "Emission",
            "Wavelength (nm)",
        )
        self.field = ChartBox(
            "Flat field",
            "Relative gain of the camera over its image, without the fall-off of the light; the mean is 1.",
            "Row (px)",
            "Column (px)",
            prepare=self._prepare_field,
        )
        self.image = pg.ImageItem(axisOrder="row-major")
        self.bar: Any = None
        self.table = NumberTable("Signals of white", HEADS)
        self.words = label("", "muted", wraps=True)
        self._lay_out()

    def _prepare_field(self, plot: Any) -> None:
        like_a_picture(plot)
        self.bar = pg.ColorBarItem(interactive=False, width=12, colorMap=pg.colormap.get("viridis"))
        self.bar.setImageItem(self.image, insert_in=plot.getPlotItem())
        theme_bar(self.bar, self._theme)

    def _lay_out(self) -> None:
        charts = side_by_side(self.emission, self.field)
        charts.setContentsMargins(0, 0, 0, 6)
        title = label("Signals of white at unit shading, DN/ms", "heading")
        below = boxed(column_of(title, (self.table, 1), self.words, margins=0))
        column_of(stacked(charts, below, (330, 170)), on=self, margins=0)

    def _draw_record(self, record: SpectralonCalibration) -> None:
        if self.bar is not None:
            theme_bar(self.bar, self._theme)
        self.emission.draw(lambda: self._draw_emission(record))
        self.field.draw(lambda: self._draw_field(record))
        self.table.fill(_rows(record))
        self.words.setText(_words(record))

    def _draw_emission(self, record: SpectralonCalibration) -> None:
        self.emission.begin()
        draw_curves(self.emission, channel_curves(record.emission.curves))

    def _draw_field(self, record: SpectralonCalibration) -> None:
        flat = record.flat_field
        gain = np.array(flat.gain)
        if min(gain.shape) < 2:
            self.field.say("The camera is even: no variation over the image stands out from the noise.")
            return
        self.field.begin()
        self.field.item.addItem(self.image)
        self.image.setImage(gain, autoLevels=False)
        rows, columns = np.array(flat.rows_px), np.array(flat.columns_px)
        # Nodes are centres of the pixels of this picture.
        half_x, half_y = np.diff(columns).mean() / 2, np.diff(rows).mean() / 2
        self.image.setRect(
            columns[0] - half_x, rows[0] - half_y, np.ptp(columns) + 2 * half_x, np.ptp(rows) + 2 * half_y
        )
        spread = max(float(np.abs(gain - 1).max()), 0.005)
        self.bar.setLevels((1 - spread, 1 + spread))
        self.field.item.autoRange(padding=0.01)


def _rows(record: SpectralonCalibration) -> list[list[Cell]]:
    white = record.white
    return [
        [
            name,
            *(
                with_spread(value, value * rel)
                for value, rel in zip(white.signal[c], white.rel_std[c], strict=True)
            ),
            f"{white.white_over_sum[c]:.4f}",
        ]
        for c, name in enumerate(CHANNELS)
    ]


def _words(record: SpectralonCalibration) -> str:
    emission, plane = record.emission, record.plane
    added = with_spread(emission.additivity, emission.additivity_std)
    return (
        f"White over the sum of the LEDs, by spectra: {added}, from {emission.readings} readings. Target"
        f" {plane.distance_mm:.0f} mm away, tilted by {plane.tilt_deg:.1f}°. Unevenness left by the flat"
        f" field: {100 * record.unevenness:.2f} % RMS; reduced χ² of an even camera"
        f" {record.flat_field_chi_square:.1f}."
    )
