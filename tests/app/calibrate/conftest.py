"""Benches of the calibrations, without a window and with one."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from dsl_app.calibrate.evidence.base import PlainEvidence
from pytestqt.qtbot import QtBot

from dsl_core.model.frames import Frame
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.calibrate.calibrate_bench import CalibrateBench, make_bench, with_a_campaign
from tests.app.calibrate.page_stage import Stage


@pytest.fixture
def bench(tmp_path: Path) -> CalibrateBench:
    return with_a_campaign(make_bench(tmp_path))


@pytest.fixture
def stage(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stage]:
    # The small calibrations bear the names of real ones, but not their records.
    monkeypatch.setattr("dsl_app.calibrate.wizard.fit_page.make_evidence", lambda name: PlainEvidence())
    made = Stage(qtbot, tmp_path)
    made.bench.control.begin_campaign(made.bench.campaign)
    made.idle()
    yield made
    made.finish()


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    snap = SimCamera.snap

    def slowly(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        time.sleep(0.3)
        return snap(self, timeout_ms)

    monkeypatch.setattr(SimCamera, "snap", slowly)
