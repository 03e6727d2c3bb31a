"""The lines under the picture: values of the pixel under the cursor, and why it is limited if it is."""

from __future__ import annotations

import math

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame

from dsl_app.results.state import ResultsState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.spectrum import Pixel, number_text, number_with_std
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.layouts import column_of
from dsl_core.evaluation.marks import explain_pixel
from dsl_core.io.result.result_arrays import ResultArrays

HINT = "Point at the picture to read a pixel."
#: What is between two values of a pixel.
BETWEEN = "   ·   "
#: As long as the values of a pixel may be.
LONGEST = "pixel 0000, 0000   ·   x −000.0  y −000.0  z 0000.00 ± 0.00 mm   ·   000 nm  0.000 ± 0.000"


def pixel_text(result: ResultArrays, pixel: Pixel, band: int) -> str:
    """Pixel, position, depth and reflectance in the current band, with deviations."""
    x_px, y_px = result.in_picture(pixel)
    parts = [f"pixel {x_px}, {y_px}"]
    if "points_mm" in result.arrays:
        x, y, z = (float(v) for v in result.at("points_mm", pixel))
        spread = float(result.at("depth_std_mm", pixel)) if "depth_std_mm" in result.arrays else math.nan
        place = f"x {number_text(x, 1)}  y {number_text(y, 1)}  z {number_with_std(z, spread, 2)} mm"
        parts.append(place if math.isfinite(z) else "no depth")
    if result.has_spectra:
        value, std = (
            float(result.at(name, pixel)[band]) if name in result.arrays else math.nan
            for name in ("reflectance", "reflectance_std")
        )
        known = number_with_std(value, std, 3) if math.isfinite(value) else "no reflectance"
        parts.append(f"{result.wavelengths_nm[band]:g} nm  {known}")
    return BETWEEN.join(parts)


def limits_text(result: ResultArrays, pixel: Pixel) -> str:
    """Why a pixel is limited, or that it is not."""
    share = result.at("data_share", pixel) if "data_share" in result.arrays else None
    spread = float(result.at("depth_std_mm", pixel)) if "depth_std_mm" in result.arrays else None
    sentences = explain_pixel(int(result.at("flags", pixel)), result.wavelengths_nm, share, spread)
    if sentences:
        return f"Limited: {'; '.join(sentences)}."
    return "This result has no flags." if "flags" in result.missing else "This pixel has no flags."


class PixelInfo(QFrame):
    """Follows the cursor and band of a state."""

    def __init__(self, state: ResultsState) -> None:
        super().__init__()
        self._state = state
        self.values = label(HINT, wraps=True, name="Pixel under the cursor", can_be_copied=True)
        self.values.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.reasons = label("", "muted", wraps=True, name="Why this pixel is limited", can_be_copied=True)
        self.reasons.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.reasons.setMinimumHeight(2 * self.reasons.fontMetrics().lineSpacing() + 2)
        for each in (self.values, self.reasons):
            each.setTextFormat(Qt.TextFormat.PlainText)
            each.setSizePolicy(each.sizePolicy().Policy.Ignored, each.sizePolicy().verticalPolicy())
        column_of(self.values, self.reasons, on=self, margins=(0, 2, 0, 0), spacing=2)
        follow_any(self._show, state.cursor, state.band)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the room of a second line where the values need one: nothing moves with the cursor."""
        super().resizeEvent(event)
        metrics = self.values.fontMetrics()
        lines = 1 if event.size().width() >= metrics.horizontalAdvance(LONGEST) else 2
        self.values.setMinimumHeight(lines * metrics.lineSpacing() + 2)

    def _show(self) -> None:
        result, pixel = self._state.result.value, self._state.cursor.value
        if result is None or pixel is None:
            self.values.setText(HINT)
            self.reasons.setText("")
            return
        parts = pixel_text(result, pixel, self._state.band.value).split(BETWEEN)
        # A line ends between two values, and not before a unit or a deviation.
        self.values.setText(BETWEEN.join(part.replace(" ", chr(0xA0)) for part in parts))
        self.reasons.setText(limits_text(result, pixel))
