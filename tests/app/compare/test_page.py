"""The two tabs of the Compare page."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.shared.widgets.open_dialog import OpenDialog
from pytestqt.qtbot import QtBot

from tests.app.support.compare_page import Bench
from tests.app.support.compare_page import bench as bench
from tests.app.support.compare_page import stage as stage


def test_two_results_dropped_together_are_both_opened(qtbot: QtBot, bench: Bench, stage: list[Path]) -> None:
    bench.drop(*stage[:2])
    qtbot.waitUntil(lambda: bench.pair.pair.value is not None, timeout=30_000)
    pair = bench.pair.pair.value
    assert pair is not None
    assert (pair.first.name, pair.second.name) == ("stage 700 mm", "stage 725 mm")


def test_the_action_leads_to_the_series(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    monkeypatch.setattr(OpenDialog, "ask", lambda _parent, title, **_: asked.append(title))
    bench.page.page_actions()["series_add"]()
    assert bench.page.tabs.currentIndex() == 1
    assert asked == ["Add a result, or a folder that contains several"]
