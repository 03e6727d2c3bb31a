"""The pages of a wizard at its left: settings, steps with their state, fit."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from dsl_app.shared.theme import DARK, Theme
from dsl_core.campaign.session import State, StepStatus

_MARKS: dict[State, str] = {"missing": "○", "captured": "✓", "refused": "✗"}
WIDTH_PX = 250


class StepList(QListWidget):
    """``chosen`` tells the page that a person wants."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self._theme = DARK
        self._statuses: tuple[StepStatus, ...] = ()
        self._has_fit = False
        self.setAccessibleName("Steps")
        self.setToolTip("Steps of this calibration: ○ to capture, ✓ captured, ✗ refused")
        self.setFixedWidth(WIDTH_PX)
        self.setSpacing(2)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.currentRowChanged.connect(self._choose)

    def _choose(self, row: int) -> None:
        if row >= 0:
            self.chosen.emit(row)

    def show_steps(self, statuses: tuple[StepStatus, ...], has_fit: bool) -> None:
        """Show where every step stands; the page that is shown stays."""
        self._statuses, self._has_fit = statuses, has_fit
        row = self.currentRow()
        self.blockSignals(True)
        self.clear()
        self._add("⚙", "Settings", "", self._theme.muted)
        colours = {"missing": self._theme.muted, "captured": self._theme.good, "refused": self._theme.bad}
        for each in statuses:
            self._add(_MARKS[each.state], each.step.title, each.state, colours[each.state], each.reason)
        mark, colour = ("✓", self._theme.good) if has_fit else ("○", self._theme.muted)
        self._add(mark, "Fit and judge", "fitted" if has_fit else "not fitted", colour)
        self.setCurrentRow(max(row, 0))
        self.blockSignals(False)

    def _add(self, mark: str, title: str, state: str, colour: str, reason: str = "") -> None:
        item = QListWidgetItem(f"{mark}  {title}")
        item.setForeground(QColor(colour if mark in ("✓", "✗") else self._theme.text))
        item.setToolTip(f"{title}: {reason or state}" if state else title)
        item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{title}, {state}" if state else title)
        self.addItem(item)

    def mark(self, page: int) -> None:
        """Show a page as the one at hand."""
        self.blockSignals(True)
        self.setCurrentRow(page)
        self.blockSignals(False)

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.show_steps(self._statuses, self._has_fit)
