"""A line of text that is cut off says so."""

from __future__ import annotations

from dsl_app.shared.widgets.clipped_label import LEAST_PX, ClippedLabel
from pytestqt.qtbot import QtBot

FACTS, PATH = "445 x 290 px · ", "/a/long/folder/of/scans/of/many/days/color-checker.zarr"


def test_a_path_loses_its_middle_and_facts_stay(qtbot: QtBot) -> None:
    label = ClippedLabel()
    qtbot.addWidget(label)
    label.setText(FACTS + PATH)
    facts_px = label.fontMetrics().horizontalAdvance(FACTS)
    whole_px = label.fontMetrics().horizontalAdvance(FACTS + PATH)
    label.resize(whole_px + 1, 30)
    assert label.shown == FACTS + PATH
    label.resize((facts_px + whole_px) // 2, 30)
    assert label.shown.startswith(FACTS + "/a/")
    assert label.shown.endswith("checker.zarr")
    assert "…" in label.shown
    label.resize(facts_px + LEAST_PX // 2, 30)
    assert label.shown.startswith(FACTS.strip())
    assert label.shown.endswith("…")
    # What is copied, and read to the blind, is the whole text.
    assert label.text() == FACTS + PATH


def test_what_is_painted_is_what_fits(qtbot: QtBot) -> None:
    label, short = ClippedLabel(), ClippedLabel()
    for each in (label, short):
        qtbot.addWidget(each)
    label.setText(FACTS + PATH)
    label.resize(label.fontMetrics().horizontalAdvance(FACTS + PATH) - 100, 30)
    short.setText(label.shown)
    short.resize(label.size())
    assert label.grab().toImage() == short.grab().toImage()
