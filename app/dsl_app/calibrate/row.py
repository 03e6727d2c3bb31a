"""One calibration of the campaign as a row: state, key figure, date, and the button that runs it."""

from __future__ import annotations

from datetime import datetime

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QPushButton, QWidget

from dsl_app.calibrate.figures_table import value_words
from dsl_app.calibrate.state import Row, RowState
from dsl_app.shared.widgets.forms import label, set_role
from dsl_core.model.figure import Figure

_ROLES = {
    RowState.MISSING: "muted",
    RowState.GOOD: "good",
    RowState.OTHER_RIG: "bad",
    RowState.DAMAGED: "bad",
}
_NAME_PX, _STATE_PX, _DATE_PX, _BUTTON_PX = 236, 154, 118, 100


class CalibrationRow(QFrame):
    """Shows a `Row`; ``wanted`` tells the name of the calibration to run."""

    wanted = Signal(str)

    def __init__(self, row: Row, number: int) -> None:
        super().__init__()
        self.setProperty("role", "card")
        self._row = row
        self._title = label(f"{number}   {row.about.title}", "heading")
        self._purpose = _small("muted")
        self._purpose.setText(row.about.purpose)
        self._state, self._figure, self._date = label(""), label(""), label("", "muted")
        self._figure.setWordWrap(True)
        self._reason = _small("muted")
        self.run = QPushButton()
        self.run.clicked.connect(lambda: self.wanted.emit(self._row.name))
        self._lay_out()
        self.show_row(row)

    def _lay_out(self) -> None:
        grid = QGridLayout(self)
        grid.setContentsMargins(12, 6, 8, 6)
        grid.setHorizontalSpacing(12)
        grid.setVerticalSpacing(1)
        top: tuple[tuple[QWidget, int], ...] = (
            (self._title, _NAME_PX),
            (self._state, _STATE_PX),
            (self._figure, 0),
            (self._date, _DATE_PX),
        )
        for column, (widget, width) in enumerate(top):
            widget.setMinimumWidth(width)
            grid.addWidget(widget, 0, column, Qt.AlignmentFlag.AlignTop)
        grid.setColumnStretch(2, 1)
        grid.addWidget(self._purpose, 1, 0, Qt.AlignmentFlag.AlignTop)
        grid.addWidget(self._reason, 1, 1, 1, 3, Qt.AlignmentFlag.AlignTop)
        self.run.setFixedWidth(_BUTTON_PX)
        grid.addWidget(self.run, 0, 4, 2, 1, Qt.AlignmentFlag.AlignVCenter)
        self._purpose.setFixedWidth(_NAME_PX)

    def show_row(self, row: Row) -> None:
        """Show where the calibration stands."""
        self._row = row
        self._state.setText(f"● {row.state.value}")
        set_role(self._state, _ROLES.get(row.state, "warn"))
        self._figure.setText("" if row.figure is None else figure_words(row.figure))
        set_role(self._figure, "" if row.figure is None or row.figure.passed else "bad")
        self._date.setText(short_date(row.accepted))
        self._date.setToolTip("When it was accepted")
        self._reason.setText(row.reason)
        self._reason.setToolTip(row.reason)
        title = row.about.title
        begun = row.state is RowState.BEGUN or row.has_candidate
        word = "Continue…" if begun else ("Open…" if row.accepted else "Run…")
        self.run.setText(word)
        self.run.setAccessibleName(f"{word.rstrip('…')} {title}")
        self.run.setToolTip(f"Open the wizard of {title}, which goes on where it was left")
        self.setAccessibleName(f"{title}: {row.state.value}. {row.reason}".strip())


def figure_words(figure: Figure) -> str:
    """A figure against its limits in one line, such as ``camera error 0.051 px (at most 0.5)``."""
    limits = figure.limits.replace("-", "−")
    return f"{figure.name} {value_words(figure)}" + (f"  ({limits})" if limits else "")


def short_date(time: str) -> str:
    """A time of ISO 8601 to the minute, where the reader lives; empty stays empty."""
    return datetime.fromisoformat(time).astimezone().strftime("%Y-%m-%d %H:%M") if time else ""


def _small(role: str) -> QLabel:
    made = label("", role)
    made.setWordWrap(True)
    return made
