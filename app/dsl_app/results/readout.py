"""The line under the picture: what the pixel under the cursor is, and why it is bad when it is."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QVBoxLayout

from dsl_app.results.state import ResultsState
from dsl_app.shared.spectrum import Pixel
from dsl_app.shared.widgets.forms import label
from dsl_core.evaluation.marks import explain_pixel
from dsl_core.io.result.result_arrays import ResultArrays

REST = "Point at the picture to read a pixel."


def number(value: float, decimals: int) -> str:
    """A number with a typographic minus; a dash where there is none.

    >>> number(-1.25, 1)
    '−1.2'
    """
    return f"{value:.{decimals}f}".replace("-", "−") if np.isfinite(value) else "–"


def describe(result: ResultArrays, pixel: Pixel, band: int) -> str:
    """Pixel, position, depth and the band at hand, each with its deviation."""
    parts = [f"pixel {pixel[0]}, {pixel[1]}"]
    if "points_mm" in result.arrays:
        x, y, z = (float(v) for v in result.at("points_mm", pixel))
        spread = float(result.at("depth_std_mm", pixel)) if "depth_std_mm" in result.arrays else np.nan
        parts.append(f"x {number(x, 1)}  y {number(y, 1)}  z {number(z, 2)} ± {number(spread, 2)} mm")
    if result.has_spectra:
        value, std = (
            float(result.at(name, pixel)[band]) if name in result.arrays else np.nan
            for name in ("reflectance", "reflectance_std")
        )
        nm = result.wavelengths_nm[band]
        parts.append(f"{nm:g} nm  {number(value, 3)} ± {number(std, 3)}")
    return "   ·   ".join(parts)


def verdict(result: ResultArrays, pixel: Pixel) -> str:
    """Why the pixel is bad, in words; empty when it is not."""
    share = result.at("data_share", pixel) if "data_share" in result.arrays else None
    spread = float(result.at("depth_std_mm", pixel)) if "depth_std_mm" in result.arrays else None
    sentences = explain_pixel(int(result.at("flags", pixel)), result.wavelengths_nm, share, spread)
    return "; ".join(sentences)


class Readout(QFrame):
    """Follows the cursor and band of a state."""

    def __init__(self, state: ResultsState) -> None:
        super().__init__()
        self._state = state
        self.values = label(REST)
        self.values.setAccessibleName("Pixel under the cursor")
        self.reasons = label("", "muted")
        self.reasons.setAccessibleName("Why this pixel is limited")
        self.reasons.setWordWrap(True)
        self.reasons.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.reasons.setMinimumHeight(2 * self.reasons.fontMetrics().lineSpacing() + 2)
        for each in (self.values, self.reasons):
            each.setTextFormat(Qt.TextFormat.PlainText)
            each.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            each.setSizePolicy(each.sizePolicy().Policy.Ignored, each.sizePolicy().verticalPolicy())
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 2, 0, 0)
        column.setSpacing(2)
        column.addWidget(self.values)
        column.addWidget(self.reasons)
        state.cursor.follow(lambda _: self._show())
        state.band.changed.connect(lambda _: self._show())

    def _show(self) -> None:
        result, pixel = self._state.result.value, self._state.cursor.value
        if result is None or pixel is None:
            self.values.setText(REST)
            self.reasons.setText("")
            return
        self.values.setText(describe(result, pixel, self._state.band.value))
        text = verdict(result, pixel)
        self.reasons.setText(f"Limited: {text}." if text else "Nothing to remark on this pixel.")
