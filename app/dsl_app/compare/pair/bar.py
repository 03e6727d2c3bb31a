"""What the pictures of a comparison show, and their values under the cursor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QSlider, QWidget

from dsl_app.compare.commands import CompareCommands
from dsl_app.compare.pair.state import CompareState, Pair, Shown
from dsl_app.shared.widgets.forms import ChoiceBox, label

BAND_PX = 260


class CompareBar(QWidget):
    """Follows a `CompareState`; chooses depth or a band."""

    def __init__(self, state: CompareState, commands: CompareCommands) -> None:
        super().__init__()
        self._state, self._commands = state, commands
        self.shown = ChoiceBox("Pictures show", "Depth, or one band of reflectance")
        for each in Shown:
            self.shown.addItem(each.value, each)
        self.band = QSlider(Qt.Orientation.Horizontal)
        self.band.setAccessibleName("Band")
        self.band.setToolTip("The common band that the pictures show")
        self.band.setFixedWidth(BAND_PX)
        self.nm, self.readout = label("", "muted"), label("", "muted")
        self.readout.setAccessibleName("Values under the cursor")
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        for widget in (self.shown, self.band, self.nm):
            row.addWidget(widget)
        row.addStretch(1)
        row.addWidget(self.readout)
        self.shown.activated.connect(lambda _: self._choose_shown())
        self.band.valueChanged.connect(commands.set_band)
        self.stops: list[Callable[[], None]] = [
            state.pair.follow(self._show_pair),
            state.shown.follow(lambda _: self._show_shown()),
            state.band.follow(lambda _: self._show_shown()),
            state.cursor.follow(lambda _: self._show_readout()),
        ]

    def _choose_shown(self) -> None:
        self._commands.show(self.shown.currentData())
        # What was refused is shown as it is.
        self._show_shown()

    def _show_pair(self, pair: Pair | None) -> None:
        self.band.setRange(0, max(len(pair.bands) - 1, 0) if pair else 0)
        self._show_shown()

    def _show_shown(self) -> None:
        state = self._state
        pair, in_band = state.pair.value, state.shown.value is Shown.BAND
        self.shown.setCurrentIndex(self.shown.findData(state.shown.value))
        self.band.setVisible(in_band)
        self.nm.setVisible(in_band)
        if pair is not None and pair.bands:
            self.band.blockSignals(True)
            self.band.setValue(state.band.value)
            self.band.blockSignals(False)
            self.nm.setText(f"{pair.nm(state.band.value):g} nm")
        self._show_readout()

    def _show_readout(self) -> None:
        state = self._state
        pair, pixel = state.pair.value, state.cursor.value
        images = None if pair is None else pair.images(state.shown.value, state.band.value)
        if images is None or pixel is None:
            self.readout.setText("Move over a picture to compare values." if images else "")
            return
        a, b = (float(image[pixel[1], pixel[0]]) for image in images)
        decimals, unit = (2, " mm") if state.shown.value is Shown.DEPTH else (3, "")
        words = [
            f"{name} {_number(value, decimals)}{unit}"
            for name, value in (("A", a), ("B", b), ("A − B", a - b))
        ]
        self.readout.setText(f"column {pixel[0]}, row {pixel[1]}:   {'   '.join(words)}")


def _number(value: float, decimals: int) -> str:
    return "–" if not np.isfinite(value) else f"{value:.{decimals}f}".replace("-", "−")
