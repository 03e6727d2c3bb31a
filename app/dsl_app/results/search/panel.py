"""Where in the picture a spectrum occurs (spectral angle), or only its colour (metamers)."""

from __future__ import annotations

from PySide6.QtWidgets import QFormLayout, QWidget

from dsl_app.results.search.controller import SearchController
from dsl_app.results.state import ResultsState, Search, SearchMode
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, label, push_button
from dsl_app.shared.widgets.layouts import STRETCH, row_of
from dsl_core.words import capitalised

HINT = "Select a pin, region or reference, or point at a pixel; then search the whole picture for it."
#: What is said where no pixel can be compared.
NONE_HAS = {
    SearchMode.SPECTRUM: "No pixel of this result has a spectrum.",
    SearchMode.METAMERS: (
        "No pixel of this result has a colour: it has no spectra, or too few bands from about 430 to 660 nm."
    ),
}
#: A limit so many times the angle that deviations make alone is exceeded by few pixels by chance.
CLEAR_OF_NOISE = 2.0


class SearchPanel(QWidget):
    """Follows the search of a state and asks its controller."""

    def __init__(self, state: ResultsState, control: SearchController) -> None:
        super().__init__()
        self._control = control
        self.mode = ChoiceBox(
            "Search for",
            "The same spectrum, or pixels of the same colour under D65 but another spectrum",
            [(capitalised(mode.value), mode) for mode in SearchMode],
        )
        self.angle = NumberBox("Limit of the spectral angle", 0.001, 1.0, 0.05, "rad", 3)
        self.angle.setSingleStep(0.005)
        self.delta_e = NumberBox("Limit of the colour difference CIEDE2000", 0.1, 20.0, 2.0, "", 1)
        self.delta_e.setSingleStep(0.5)
        self.start = push_button("Search", "Compare every pixel with the selected spectrum")
        self.clear = push_button("Clear", "Show the picture without the search", control.clear)
        self.text = label(HINT, "muted", wraps=True)
        buttons = row_of(self.start, self.clear, STRETCH)
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow("Search for", self.mode)
        form.addRow("Angle", self.angle)
        form.addRow("ΔE00 up to", self.delta_e)
        form.addRow(buttons)
        form.addRow(self.text)
        self.start.clicked.connect(lambda: control.start(self._chosen))
        self.mode.currentIndexChanged.connect(lambda _: self._choose())
        self.angle.valueChanged.connect(lambda _: self._limit())
        self.delta_e.valueChanged.connect(lambda _: self._limit())
        state.search.follow(self._show)
        self._choose()

    @property
    def _chosen(self) -> SearchMode:
        return SearchMode(self.mode.currentData())

    def _choose(self) -> None:
        metamers = self._chosen is SearchMode.METAMERS
        self.delta_e.setEnabled(metamers)
        self.angle.setToolTip(plain_tip(f"Finds pixels with a {'larger' if metamers else 'smaller'} angle"))
        self._control.set_mode(self._chosen)

    def _limit(self) -> None:
        self._control.set_limits(self.angle.value(), self.delta_e.value())

    def _show(self, search: Search | None) -> None:
        self.clear.setEnabled(search is not None)
        if search is not None and (search.within_rad, search.within_delta_e) != (
            self.angle.value(),
            self.delta_e.value(),
        ):
            self._limit()
            return
        if search is not None and search.mode is not self._chosen:
            # Chosen while the search ran: what is shown is what the panel says.
            self._control.set_mode(self._chosen)
            return
        self.text.setText(search_text(search))


def search_text(search: Search | None) -> str:
    """The share of pixels found, in a sentence."""
    if search is None:
        return HINT
    if search.share is None:
        return NONE_HAS[search.mode]
    criteria = {
        SearchMode.SPECTRUM: f"have the spectrum of {search.name} (angle up to {search.within_rad:g} rad)",
        SearchMode.METAMERS: (
            f"look like {search.name} (ΔE00 up to {search.within_delta_e:g}) but differ by more than"
            f" {search.within_rad:g} rad"
        ),
    }
    found = f"{100 * search.share:.2f} % of the pixels with a spectrum {criteria[search.mode]}."
    noise = search.noise_of_alike_rad
    if noise <= search.within_rad / CLEAR_OF_NOISE:
        return found
    return (
        f"{found} Deviations alone make angles of about {noise:.2g} rad here: choose {CLEAR_OF_NOISE:g} times"
        " that, or more."
    )
