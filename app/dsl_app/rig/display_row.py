"""The controls by which the live picture is shown; nothing that is saved depends on them."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QSlider, QWidget

from dsl_app.shared.widgets.forms import ChoiceBox, check_box, label, named
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_core.capture.display import FIRST, Display, Tone

#: Steps of the gain's slider for a factor of two, and the highest gain in factors of two.
STEPS, DOUBLINGS = 4, 6


class DisplayRow(QWidget):
    """Emits ``changed`` when something else is chosen."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.display: Display = FIRST
        tip = "How counts become brightness: a logarithm shows the first orders of a line next to its zeroth"
        self.tone = ChoiceBox(
            "Tone", tip, [(tone.value, tone) for tone in Tone], lambda tone: self._be(tone=tone)
        )
        self.stretch = check_box("Stretch", "Fit black and white to the darkest and brightest pixels shown")
        self.balance = check_box(
            "White balance",
            "Make the means of red, green and blue equal, for the eye; light of one colour keeps it",
        )
        self.stretch.setChecked(FIRST.stretch)
        self.balance.setChecked(FIRST.balance)
        self.gain = named(QSlider(Qt.Orientation.Horizontal), "Gain", "Brighten the picture, up to 64 times")
        self.gain.setRange(0, STEPS * DOUBLINGS)
        self.gain.setFixedWidth(90)
        self.gain.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._factor = label("× 1", "muted")
        self._factor.setMinimumWidth(self._factor.fontMetrics().horizontalAdvance("× 64.0"))
        self.stretch.toggled.connect(lambda on: self._be(stretch=on))
        self.balance.toggled.connect(lambda on: self._be(balance=on))
        self.gain.valueChanged.connect(lambda step: self._be(gain=2.0 ** (step / STEPS)))
        chosen = row_of(self.tone, self.stretch, self.balance, STRETCH, margins=0, spacing=6)
        gain = row_of(label("Gain"), self.gain, self._factor, STRETCH, margins=0, spacing=6)
        # One below the other: side by side they are wider than the picture in a small window.
        column_of(chosen, gain, on=self, margins=0, spacing=4)

    def _be(self, **parts: Tone | bool | float) -> None:
        self.display = replace(self.display, **parts)  # type: ignore[arg-type]
        self._factor.setText(f"× {self.display.gain:.3g}")
        self.changed.emit()
