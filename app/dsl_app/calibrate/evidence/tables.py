"""Tables of numbers that evidence shows, and how numbers are written with their deviation."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtWidgets import QTableWidgetItem

from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.read_table import LEFT, RIGHT, ReadTable, cell
from dsl_core.model.figure import with_std

#: A number or words of a table, alone or with its role: text, good, warn, bad or muted.
Cell = str | tuple[str, str]


class NumberTable(ReadTable):
    """Read-only rows of numbers with digits of equal width, right-aligned below their heads."""

    def __init__(self, name: str, heads: Sequence[tuple[str, str]], words: Sequence[int] = (0,)) -> None:
        """``heads`` are names and tooltips of the columns; ``words`` are the columns that hold words."""
        super().__init__(name, "", [head for head, _ in heads])
        self._words = set(words)
        for column, (_, tip) in enumerate(heads):
            head = self.horizontalHeaderItem(column)
            assert head is not None
            head.setToolTip(plain_tip(tip))
            head.setTextAlignment(LEFT if column in self._words else RIGHT)
        self.be_dense()
        self.horizontalHeader().setStretchLastSection(len(heads) - 1 in self._words)

    def fill(self, rows: Sequence[Sequence[Cell]]) -> None:
        """Show other rows, with typographic minus signs."""
        self.show_rows([[self._item(each, i) for i, each in enumerate(row)] for row in rows])

    def _item(self, each: Cell, column: int) -> QTableWidgetItem:
        text, role = (each, "text") if isinstance(each, str) else each
        if column in self._words:
            return cell(text, role)
        return cell(text.replace("-", "−"), role, RIGHT)


def with_spread(value: float, std: float) -> str:
    """A value and its deviation with two digits of the deviation, down to a ten-thousandth.

    >>> with_spread(210.8184, 0.0204), with_spread(3.0, 0.0)
    ('210.818 ± 0.020', '3')
    """
    return with_std(value, std, most=4)
