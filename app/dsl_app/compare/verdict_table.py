"""A table of figures with their values and units."""

from __future__ import annotations

from collections.abc import Iterable

from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from dsl_core.evaluation.verdict import Verdict

#: Room for most names of figures; longer ones are wrapped.
TABLE_PX = 400


class VerdictTable(ReadTable):
    """One row per figure."""

    def __init__(self, name: str, tip: str) -> None:
        super().__init__(name, tip, ("Figure", "Value", "Unit"))
        self.setMinimumWidth(TABLE_PX)
        # In a wide window values stay next to the names that they belong to.
        self.wrap(0, fills=False)

    def show_verdicts(self, verdicts: Iterable[Verdict]) -> None:
        """Show other figures."""
        self.show_rows(
            [
                (cell(each.figure), cell(each.words.replace("-", "−"), side=RIGHT), cell(each.unit))
                for each in verdicts
            ]
        )
