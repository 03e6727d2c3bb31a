"""Two results, or one and its truth: pictures and difference above, spectra and figures below."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QHBoxLayout, QSplitter, QVBoxLayout, QWidget

from dsl_app.compare.commands import CompareCommands
from dsl_app.compare.pair.bar import CompareBar
from dsl_app.compare.pair.figures import CompareFigures
from dsl_app.compare.pair.state import CompareState, Pair, Side
from dsl_app.compare.view import CompareView
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.forms import label, push_button, remark_line, set_role, show_remark

NOTHING = (
    "Open a result as A, then another one as B, or take the truth of its twin as B."
    " Results (folders NAME.zarr) can be dropped here."
)


class ComparePair(QWidget):
    """Follows a `CompareState` and asks a controller."""

    def __init__(self, state: CompareState, commands: CompareCommands) -> None:
        super().__init__()
        self._state, self._commands = state, commands
        self.names = [label("A: –", "heading"), label("B: –", "heading")]
        self.open_first = push_button("Open &A…", "Choose the result to look at")
        self.open_second = push_button("Open &B…", "Choose the result to compare it with")
        self.truth = push_button(
            "&Truth as B", "Take what the twin knows of the scene of A, where a twin took it"
        )
        self.swap = push_button("&Swap", "Let A and B change places")
        self.report = push_button(
            "Write &report…", "Figures and pictures of A against the truth as an HTML page"
        )
        self.hint = remark_line()
        self._view = Deferred(self._make_view)
        self.bar = CompareBar(state, commands)
        self._figures = Deferred(lambda: CompareFigures(state))
        self._stops: list[Callable[[], None]] = []
        self._lay_out()
        self._connect()

    @property
    def view(self) -> CompareView:
        """The three pictures, made when somebody looks."""
        return self._view.content

    @property
    def figures(self) -> CompareFigures:
        """Spectra and figures, made when somebody looks."""
        return self._figures.content

    def _make_view(self) -> CompareView:
        made = CompareView(self._state)
        made.pointed.connect(self._commands.point_at)
        return made

    def _lay_out(self) -> None:
        head = QHBoxLayout()
        head.addWidget(self.names[0])
        head.addWidget(self.open_first)
        head.addSpacing(24)
        head.addWidget(self.names[1])
        for button in (self.open_second, self.truth):
            head.addWidget(button)
        head.addStretch(1)
        for button in (self.swap, self.report):
            head.addWidget(button)
        above = QWidget()
        upper = QVBoxLayout(above)
        upper.setContentsMargins(0, 0, 0, 0)
        upper.addWidget(self._view, 1)
        upper.addWidget(self.bar)
        self.parts = QSplitter(Qt.Orientation.Vertical)
        self.parts.setChildrenCollapsible(False)
        for i, (widget, stretch) in enumerate(((above, 5), (self._figures, 4))):
            self.parts.addWidget(widget)
            self.parts.setStretchFactor(i, stretch)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 8, 0, 0)
        column.addLayout(head)
        column.addWidget(self.hint)
        column.addWidget(self.parts, 1)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.open_first.clicked.connect(lambda: self._choose(second=False))
        self.open_second.clicked.connect(lambda: self._choose(second=True))
        self.truth.clicked.connect(commands.use_truth)
        self.swap.clicked.connect(commands.swap)
        self.report.clicked.connect(self._choose_report)
        self._stops = [
            *self.bar.stops,
            state.first.follow(lambda side: self._show_side(0, side)),
            state.second.follow(lambda side: self._show_side(1, side)),
            state.pair.follow(self._show_pair),
            state.busy.follow(lambda _: self._show_hint()),
            state.trouble.follow(lambda _: self._show_hint()),
        ]

    # Ask -------------------------------------------------------------------------------------------

    def _choose(self, second: bool) -> None:
        name = QFileDialog.getExistingDirectory(self, f"Open a result as {'B' if second else 'A'}")
        if name:
            self._commands.open_side(Path(name), second)

    def _choose_report(self) -> None:
        pair = self._state.pair.value
        if pair is None:
            return
        start = pair.first.arrays.path.with_suffix(".html")
        name, _ = QFileDialog.getSaveFileName(self, "Write the report", str(start), "Web page (*.html)")
        if name:
            self._commands.write_report(Path(name))

    # Show ------------------------------------------------------------------------------------------

    def _show_side(self, i: int, side: Side | None) -> None:
        self.names[i].setText(f"{'AB'[i]}: {'–' if side is None else side.name}")
        self._show_hint()

    def _show_hint(self) -> None:
        state = self._state
        pair = state.pair.value
        text = state.trouble.value or (f"{state.busy.value}…" if state.busy.value else "")
        if not text and pair is None:
            text = NOTHING
        show_remark(self.hint, text)
        set_role(self.hint, "bad" if state.trouble.value else "muted")
        idle = not state.busy.value
        truth = state.second.value is not None and state.second.value.truth is not None
        for button in (self.open_first, self.open_second):
            button.setEnabled(idle)
        self.truth.setEnabled(idle and state.first.value is not None)
        self.swap.setEnabled(idle and pair is not None and not truth)
        self.report.setEnabled(idle and pair is not None and truth)

    def _show_pair(self, pair: Pair | None) -> None:
        self.parts.setEnabled(pair is not None)
        self._show_hint()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._view.apply_theme(theme)
        self._figures.apply_theme(theme)

    def release(self) -> None:
        """Follow nothing more."""
        late = [part.stops for part in (self._view.made, self._figures.made) if part is not None]
        for stop in (*self._stops, *chain.from_iterable(late)):
            stop()
