"""Figures next to their limits, with what to do about those that miss them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHeaderView, QTableWidgetItem

from dsl_app.calibrate.presentation import value_words
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.read_table import ReadTable, cell
from dsl_core.model.figure import Figure

_COLUMNS = ("", "Figure", "Value", "Limits", "What to do")
_MARK_PX = 26
#: A hyphen that is the sign of a number, as in ``order -1``.
_SIGN = re.compile(r"(?<!\w)-(?=\d)")


class FiguresTable(ReadTable):
    """A row for each figure: whether it passes, value ± standard deviation with unit, limits, advice."""

    def __init__(self, name: str) -> None:
        super().__init__(name, "Values with their standard deviation, against their limits", _COLUMNS)
        self._theme, self._figures = DARK, tuple[Figure, ...]()
        header = self.horizontalHeader()
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Fixed)
        header.resizeSection(0, _MARK_PX)
        self.wrap(len(_COLUMNS) - 1)

    def show_figures(self, figures: Sequence[Figure]) -> None:
        """Show figures in their order."""
        self._figures = tuple(figures)
        self.show_rows([self._items(figure) for figure in self._figures])

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.show_figures(self._figures)

    def _items(self, figure: Figure) -> tuple[QTableWidgetItem, ...]:
        theme, limited = self._theme, bool(figure.limits)
        colour = theme.text if not limited else (theme.good if figure.passed else theme.bad)
        mark = "" if not limited else ("✓" if figure.passed else "✗")
        advice = "" if figure.passed else figure.advice
        first = cell(mark, colour)
        first.setData(
            Qt.ItemDataRole.AccessibleTextRole,
            "" if not limited else ("passed" if figure.passed else "missed"),
        )
        return (
            first,
            cell(_SIGN.sub("−", figure.name), theme.text),
            cell(value_words(figure), colour if not figure.passed else theme.text),
            cell(figure.limits.replace("-", "−"), theme.muted),
            cell(advice, theme.text),
        )
