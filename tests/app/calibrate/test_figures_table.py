"""Figures against their limits in the order in which a person needs them."""

from __future__ import annotations

from dsl_app.calibrate.figures_table import FiguresTable
from dsl_app.shared.widgets.read_table import DENSE_PX
from pytestqt.qtbot import QtBot

from dsl_core.model.figure import Figure
from tests.app.calibrate.evidence_bench import row_texts

ONLY_TOLD = Figure(name="read noise", value=1.0, unit="DN")
RIGHT = Figure(name="stale frames", value=0, unit="", high=0)
WRONG = Figure(name="camera error", value=0.9, unit="px", high=0.5, advice="Add poses.")


def test_what_misses_its_limits_comes_first_and_what_only_informs_last(qtbot: QtBot) -> None:
    table = FiguresTable("Figures")
    qtbot.addWidget(table)
    table.show_figures((ONLY_TOLD, RIGHT, WRONG))
    assert [row_texts(table, row)[1:] for row in range(3)] == [
        ["Camera error", "0.900 px", "at most 0.5 px", "Add poses."],
        ["Stale frames", "0", "none allowed", ""],
        ["Read noise", "1 DN", "", ""],
    ]


def test_rows_without_advice_are_dense(qtbot: QtBot) -> None:
    table = FiguresTable("Figures")
    qtbot.addWidget(table)
    table.show_figures((ONLY_TOLD, RIGHT))
    assert [table.rowHeight(row) for row in range(2)] == [DENSE_PX] * 2
