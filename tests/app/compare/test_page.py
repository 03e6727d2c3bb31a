"""The two tabs of the Compare page."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.shared.widgets.open_dialog import OpenDialog
from pytestqt.qtbot import QtBot

from dsl_core.io.result.result_file import save_result
from dsl_core.model.result import build_result
from tests.app.support.compare_page import Bench
from tests.app.support.compare_page import bench as bench
from tests.app.support.compare_page import stage as stage
from tests.cases.stage_series import NM, flat_arrays, write_stage


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


def test_a_result_that_is_replaced_while_another_page_is_open_is_read_again(
    qtbot: QtBot, bench: Bench, tmp_path: Path
) -> None:
    bench.see()
    path = write_stage(tmp_path, 700.0)
    bench.drop(path)
    qtbot.waitUntil(lambda: bench.state.rows.value[0].target is not None, timeout=30_000)
    old = bench.state.rows.value[0].target
    bench.page.hide()
    save_result(build_result(flat_arrays(700.0, 0.4), NM, {}), path, overwrite=True)
    bench.page.show()
    qtbot.waitUntil(
        lambda: all(bench.state.rows.value[0].target is not each for each in (None, old)), timeout=30_000
    )
