"""Where in the picture a spectrum occurs (spectral angle), or only its colour (metamers)."""

from __future__ import annotations

from PySide6.QtWidgets import QFormLayout, QHBoxLayout, QLabel, QPushButton, QWidget

from dsl_app.results.commands import ResultCommands
from dsl_app.results.state import ResultsState, Search, Seek
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox

REST = "Select a pin, region or reference, or point at a pixel; then look for it in the whole picture."


class SearchPanel(QWidget):
    """Follows the search of a state and asks a controller."""

    def __init__(self, state: ResultsState, commands: ResultCommands) -> None:
        super().__init__()
        self._state, self._commands = state, commands
        self.what = ChoiceBox("Look for", "The same spectrum, or what looks alike under D65 and is not")
        for seek in Seek:
            self.what.addItem(seek.value[0].upper() + seek.value[1:], seek)
        self.angle = NumberBox("Limit of the spectral angle", 0.001, 1.0, 0.05, "rad", 3)
        self.angle.setSingleStep(0.005)
        self.delta_e = NumberBox("Limit of the colour difference CIEDE2000", 0.1, 20.0, 2.0, "", 1)
        self.delta_e.setSingleStep(0.5)
        self.start = QPushButton("Look")
        self.start.setToolTip("Compare every pixel with the selected spectrum")
        self.end = QPushButton("Clear")
        self.end.setToolTip("Show the picture without the search")
        self.text = QLabel(REST)
        self.text.setProperty("role", "muted")
        self.text.setWordWrap(True)
        buttons = QHBoxLayout()
        buttons.addWidget(self.start)
        buttons.addWidget(self.end)
        buttons.addStretch(1)
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow("Look for", self.what)
        form.addRow("Angle", self.angle)
        form.addRow("ΔE00 up to", self.delta_e)
        form.addRow(buttons)
        form.addRow(self.text)
        self.start.clicked.connect(lambda: commands.search(self._chosen))
        self.end.clicked.connect(commands.end_search)
        self.what.currentIndexChanged.connect(lambda _: self._choose())
        self.angle.valueChanged.connect(lambda _: self._limit())
        self.delta_e.valueChanged.connect(lambda _: self._limit())
        state.search.follow(self._show)
        self._choose()

    @property
    def _chosen(self) -> Seek:
        return Seek(self.what.currentData())

    def _choose(self) -> None:
        metamers = self._chosen is Seek.METAMERS
        self.delta_e.setEnabled(metamers)
        tip = "Pixels with a larger angle are found" if metamers else "Pixels with a smaller angle are found"
        self.angle.setToolTip(tip)
        self._commands.seek(self._chosen)

    def _limit(self) -> None:
        self._commands.limit_search(self.angle.value(), self.delta_e.value())

    def _show(self, search: Search | None) -> None:
        self.end.setEnabled(search is not None)
        if search is None:
            self.text.setText(REST)
            return
        if (search.within_rad, search.within_delta_e) != (self.angle.value(), self.delta_e.value()):
            self._limit()
            return
        share = search.share
        if share is None:
            self.text.setText("No pixel of this result has a spectrum.")
            return
        words = {
            Seek.SPECTRUM: f"have the spectrum of {search.name} (angle up to {search.within_rad:g} rad)",
            Seek.METAMERS: (
                f"look like {search.name} (ΔE00 up to {search.within_delta_e:g}), yet differ by more than"
                f" {search.within_rad:g} rad"
            ),
        }
        self.text.setText(f"{share:.2%} of the pixels with a spectrum {words[search.seek]}.")
