"""The evidence of a self-test: points of a real one, beats, and words where captures are gone."""

from __future__ import annotations

import shutil
from typing import Any

import numpy as np
import pytest
from dsl_app.calibrate.evidence import selftest as selftest_evidence
from dsl_app.calibrate.evidence.base import make_evidence
from dsl_app.calibrate.wizard.state import Fit
from dsl_app.shared.theme import Theme
from PySide6.QtCore import QThreadPool
from pytestqt.qtbot import QtBot

from dsl_core.campaign.selftest.recipe import SelfTestRecipe
from dsl_core.campaign.session import CalibrationSession
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.calibration.selftest import SelfTest
from tests.app.calibrate.evidence_bench import THEMES, bars, points, shown
from tests.cases.light_rig import LightWorld, light_rig


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> CalibrationSession:
    """A self-test of light with a cycle, captured."""
    campaign = CampaignFolder.begin(tmp_path_factory.mktemp("campaign"), "light", {})
    devices = light_rig(LightWorld(cycle_hz=60.0, late_ms=12.0))
    found = CalibrationSession(SelfTestRecipe(), devices, campaign)
    found.capture(found.steps[0])
    return found


@pytest.fixture(scope="module")
def record(session: CalibrationSession) -> SelfTest:
    found = session.record(session.fit())
    assert isinstance(found, SelfTest)
    return found


def words(box: Any) -> str:
    return str(box.legend.text()).replace("&nbsp;", " ")


@pytest.mark.parametrize("theme", THEMES)
def test_points_of_the_captures_are_drawn(
    qtbot: QtBot, session: CalibrationSession, record: SelfTest, theme: Theme
) -> None:
    widget = shown(qtbot, "selftest", record, session, theme)
    assert widget.linearity.sentence.text() == selftest_evidence.READING
    qtbot.waitUntil(lambda: len(points(widget.linearity)) == 3, timeout=10_000)
    for channel, percent in zip(points(widget.linearity), record.camera.linearity_percent, strict=True):
        assert np.abs(channel[:, 1]).max() == pytest.approx(percent.value)
    ramps = points(widget.gamma)
    assert len(ramps) == 4
    assert all(np.abs(ramp[ramp[:, 0] > 0.2][:, 1]).max() < 1.0 for ramp in ramps)
    waits = points(widget.latency)[0]
    assert waits[waits[:, 0] >= record.latency.wait_ms.value][:, 1].min() == 100
    assert waits[waits[:, 0] < 12.0][:, 1].max() < 100
    assert "white 2.2" in words(widget.gamma)
    assert f"of {record.latency.checked}" in words(widget.latency)


def test_the_rows_of_a_monochrome_camera_are_not_named_as_colours(
    qtbot: QtBot, session: CalibrationSession, record: SelfTest
) -> None:
    camera = record.camera.model_copy(update={"is_monochrome": True})
    widget = shown(qtbot, "selftest", record.model_copy(update={"camera": camera}), session)
    qtbot.waitUntil(lambda: len(points(widget.linearity)) == 3, timeout=10_000)
    assert "rows 1, 4, 7…, at most" in words(widget.linearity)
    assert "green" not in words(widget.linearity)


def test_beats_are_bars_in_the_order_of_exposures(
    qtbot: QtBot, session: CalibrationSession, record: SelfTest
) -> None:
    widget = shown(qtbot, "selftest", record, session)
    beats = sorted(record.cycle.beats, key=lambda beat: beat.exposure_ms)
    assert bars(widget.beat) == [pytest.approx([beat.ratio_percent.value for beat in beats])]
    assert "cycle of 16.6" in words(widget.beat)
    qtbot.waitUntil(lambda: not widget._reader.is_busy, timeout=10_000)


def test_captures_that_are_gone_are_said_in_words(
    qtbot: QtBot, session: CalibrationSession, record: SelfTest
) -> None:
    folder = session.bench.step_folder(session.steps[0])
    kept = folder.with_name("aside")
    shutil.move(folder, kept)
    try:
        widget = shown(qtbot, "selftest", record, session)
        qtbot.waitUntil(lambda: "Capture the self-test again" in widget.gamma.sentence.text(), timeout=10_000)
        assert bars(widget.beat)
    finally:
        shutil.move(kept, folder)


def test_a_widget_closed_while_it_reads_does_no_harm(
    qtbot: QtBot, session: CalibrationSession, record: SelfTest
) -> None:
    widget = make_evidence("selftest")
    widget.show_fit(Fit(AcceptedCalibration(name="selftest", title="Self-test"), record, session))
    widget.deleteLater()
    qtbot.wait(200)
    assert QThreadPool.globalInstance().waitForDone(10_000)
