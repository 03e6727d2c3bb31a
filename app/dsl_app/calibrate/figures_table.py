"""Figures next to their limits, with what to do about those that miss them."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHeaderView, QTableWidgetItem

from dsl_app.calibrate.presentation import name_words, value_words
from dsl_app.shared.widgets.read_table import ReadTable, cell
from dsl_core.model.figure import Figure
from dsl_core.words import capitalised

_COLUMNS = ("", "Figure", "Value", "Limits", "What to do")
_MARK_PX = 26


class FiguresTable(ReadTable):
    """A row for each figure: whether it passes, value ± standard deviation with unit, limits, advice."""

    def __init__(self, name: str) -> None:
        super().__init__(name, "Values with their standard deviation, against their limits", _COLUMNS)
        header = self.horizontalHeader()
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Fixed)
        header.resizeSection(0, _MARK_PX)
        self.wrap(len(_COLUMNS) - 1)

    def show_figures(self, figures: Sequence[Figure]) -> None:
        """Show what misses its limits first, then what is within them, and last what only informs."""
        self.show_rows([_items(figure) for figure in sorted(figures, key=_rank)])


def _rank(figure: Figure) -> int:
    # Five rows are seen at a time: what a person must act on is one of them.
    return 0 if not figure.passed else (1 if figure.limits else 2)


def _items(figure: Figure) -> tuple[QTableWidgetItem, ...]:
    mark, role, word = "", "text", ""
    if figure.limits:
        mark, role, word = ("✓", "good", "passed") if figure.passed else ("✗", "bad", "missed")
    first = cell(mark, role)
    first.setData(Qt.ItemDataRole.AccessibleTextRole, word)
    return (
        first,
        cell(capitalised(name_words(figure)), "text"),
        cell(value_words(figure), "text" if figure.passed else role),
        cell(figure.limits.replace("-", "−"), "muted"),
        cell("" if figure.passed else figure.advice, "text"),
    )
