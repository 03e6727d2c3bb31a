"""Numbers with their deviations, and tables of them."""

from __future__ import annotations

from dsl_app.calibrate.evidence.tables import NumberTable, with_spread
from pytestqt.qtbot import QtBot

from tests.app.calibrate.evidence_bench import row_texts


def test_numbers_are_written_as_people_do(qtbot: QtBot) -> None:
    assert with_spread(210.8184, 0.0204) == "210.818 ± 0.020"
    assert with_spread(2.06581, 0.000024) == "2.0658 ± 0.0001"
    assert with_spread(1234.5, 123.0) == "1234 ± 123"
    table = NumberTable("Numbers", [("Name", "Words"), ("Value", "Number")])
    qtbot.addWidget(table)
    table.fill([["a-b", "-1.5"]])
    assert row_texts(table, 0) == ["a-b", "−1.5"]
