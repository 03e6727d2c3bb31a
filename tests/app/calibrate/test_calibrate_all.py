"""All calibrations in order, unattended."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import cast

import pytest
from dsl_app.calibrate.calibrate_all import UnattendedGuide
from dsl_app.calibrate.overall import Overall
from dsl_app.calibrate.presentation import main_button
from dsl_app.calibrate.state import RowState
from dsl_app.connection.state import Link

from dsl_core.campaign.common.recipe import Step
from dsl_core.campaign.session import CalibrationSession
from dsl_core.errors import DeviceError
from dsl_core.model.figure import Figure
from dsl_core.progress import CallbackProgress
from dsl_core.reconstruction.spectral import rig_traits
from tests.app.calibrate.calibrate_bench import (
    CalibrateBench,
    states,
)


def test_everything_runs_in_order_and_stops_with_the_reason(
    bench: CalibrateBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.control.run_everything()
    assert "cannot place its targets itself" in bench.told
    devices = bench.rig.state.devices.value
    assert devices is not None
    devices.place = lambda placement: None
    bench.wrong = {"largest_dn": 1.0}
    bench.control.run_everything()
    assert "Brightness is outside its limits" in bench.told
    assert "Open the aperture." in bench.told
    assert bench.row("selftest").has_candidate
    # Which calibration it was, where a person goes on, and in red, as it is no news.
    outcome = bench.state.outcome.value
    assert outcome.text.startswith("Calibrating everything stopped at Self-test: Brightness is outside")
    assert (outcome.role, bench.state.refused.value) == ("bad", "selftest")
    assert main_button(bench.state, devices) == "selftest"
    bench.wrong = {}
    monkeypatch.setattr(rig_traits, "_traits", lambda rig: iter(("a film is bent", "light is uneven")))
    bench.control.run_everything()
    told = bench.state.outcome.value.text
    assert "Everything is calibrated" in told
    assert told.endswith("Measured by the calibration, and followed: a film is bent; light is uneven.")
    assert all(row.state.is_accepted for row in bench.state.rows.value)
    assert bench.state.refused.value == ""
    assert bench.library.names() == ("campaign",)


def test_a_lost_device_is_no_fault_of_the_calibration(
    bench: CalibrateBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = bench.rig.state.devices.value
    assert devices is not None
    devices.place = lambda placement: None

    def lose(*_: object) -> bool:
        raise DeviceError("The camera does not answer. Check its cable.")

    monkeypatch.setattr(UnattendedGuide, "looked", lose)
    bench.control.run_everything()
    assert "stopped at Self-test: The camera does not answer" in bench.state.outcome.value.text
    assert bench.rig.state.link.value is Link.LOST
    assert bench.state.trouble.value
    # It goes on once the device is back.
    assert main_button(bench.state, devices) == "everything"


def test_a_calibration_that_begins_is_named_at_once() -> None:
    told: list[str] = []
    guide = UnattendedGuide(CallbackProgress(lambda stage, done, total: told.append(stage)))
    session = SimpleNamespace(recipe=SimpleNamespace(title="Spectralon", name="spectralon"))
    guide.begins(cast(CalibrationSession, session), 2)
    assert told == ["Spectralon"]


def test_rows_are_live_while_everything_is_calibrated(
    bench: CalibrateBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = bench.rig.state.devices.value
    assert devices is not None
    devices.place = lambda placement: None
    seen: list[tuple[str, list[RowState], bool]] = []
    shares: list[float] = []
    texts: list[str] = []
    real = UnattendedGuide.looked

    def looked(self: UnattendedGuide, step: Step, figures: Sequence[Figure]) -> bool:
        answer = real(self, step, figures)
        bench.control.take_news()
        seen.append((bench.state.running.value, states(bench), bench.state.seen.value is not None))
        texts.append(bench.state.everything.value)
        job = bench.control._everything._job
        assert job is not None
        shares.append(job.extent[0] / job.extent[1])
        return answer

    monkeypatch.setattr(UnattendedGuide, "looked", looked)
    bench.control.run_everything()
    assert [name for name, _, _ in seen] == ["selftest", "selftest", "geometry"]
    assert seen[-1][1] == [RowState.GOOD, RowState.MISSING]
    # Two steps and a fit, a step and a fit: the bar is of all of them.
    assert shares == pytest.approx([0.0, 0.2, 0.6], abs=0.001)
    # Why no time left is told is told.
    assert texts[0].endswith("the time left is told once 4 % of everything is done")
    assert texts[1].endswith("left for everything")
    assert seen[-1][2]
    assert bench.state.running.value == ""
    assert bench.state.seen.value is None


def test_a_name_that_calibration_step_and_stage_share_is_told_once() -> None:
    told: list[str] = []
    overall = Overall({"selftest": 2})
    overall.begins("selftest", 1)
    progress = CallbackProgress(lambda stage, done, total: told.append(stage))
    guide = UnattendedGuide(progress, "Self-test", overall)
    guide.report("Self-test: self-test", 0, 8)
    assert told == ["Self-test"]
