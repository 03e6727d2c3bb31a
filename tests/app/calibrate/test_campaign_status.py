"""Where the calibrations of a campaign stand, and why."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import timedelta

from dsl_app.calibrate.campaign_status import JUDGED_BY, key_figure
from dsl_app.calibrate.state import RowState

from dsl_core.campaign.recipes import recipe_names
from dsl_core.io.campaign_folder import NOTE_NAME, CampaignFolder
from dsl_core.model.figure import Figure
from tests.app.calibrate.calibrate_bench import (
    CalibrateBench,
    calibrate,
    states,
)


def test_rows_say_why_a_calibration_is_not_good(bench: CalibrateBench) -> None:
    for name in ("selftest", "geometry"):
        calibrate(bench, name)
    bench.later = timedelta(days=91)
    bench.control.refresh()
    assert states(bench) == [RowState.AGEING, RowState.AGEING]
    assert bench.row("geometry").reason.startswith("91 days old.")
    bench.later = timedelta(0)
    bench.wrong = {"largest_dn": 1.0}
    _, control = bench.wizard("selftest")
    control.fit()
    control.accept()
    control.leave()
    assert states(bench) == [RowState.OUTSIDE, RowState.SUPERSEDED]
    assert bench.row("selftest").reason == "Open the aperture."
    assert bench.row("geometry").reason == "Changed since: Self-test. Fit again; its captures are kept."
    devices = bench.rig.state.devices.value
    assert devices is not None
    devices.camera._info = replace(devices.camera.info, binning=2)  # type: ignore[attr-defined]
    bench.control.refresh()
    assert states(bench) == [RowState.OTHER_RIG, RowState.OTHER_RIG]
    assert "The camera's binning was 1 and is 2." in bench.row("selftest").reason
    (bench.campaign / "selftest.json").write_text("{")
    bench.control.refresh()
    assert bench.row("selftest").state is RowState.DAMAGED


def test_a_row_says_how_many_of_its_steps_are_captured(bench: CalibrateBench) -> None:
    state, control = bench.wizard("selftest")
    control.go_to(state.lacking[0])
    control.capture()
    control.leave()
    assert bench.row("selftest").reason == "1 of 2 captured"
    # Captures of an earlier version do not say how many there are.
    for path in CampaignFolder.open(bench.campaign).home("selftest").glob(f"*/{NOTE_NAME}"):
        note = json.loads(path.read_text())
        path.write_text(json.dumps({key: note[key] for key in note if key not in ("steps", "checksum")}))
    bench.control.refresh()
    assert bench.row("selftest").reason == "1 captured"


def test_the_key_figure_is_the_one_nearest_to_its_limits() -> None:
    def figure(name: str, value: float, low: float | None = None, high: float | None = None) -> Figure:
        return Figure(name=name, value=value, unit="px", low=low, high=high)

    easy, tight = figure("easy", 0.1, high=0.5), figure("tight", 0.45, high=0.5)
    beyond, between = figure("beyond", 0.2, low=0.3), figure("between", 2.0, low=1.0, high=3.0)
    assert key_figure((easy, tight, between)) is tight
    assert key_figure((tight, beyond)) is beyond
    assert key_figure((figure("free", 1.0),)) is None


def test_a_person_judges_a_calibration_by_some_of_its_figures() -> None:
    used = Figure(name="poses used", value=10, unit="", low=3, high=10)
    camera = Figure(name="camera error", value=0.05, unit="px", high=0.5)
    projector = Figure(name="projector error", value=0.08, unit="px", high=0.5)
    assert key_figure((used, camera, projector), "geometry") is projector
    lost = Figure(name="poses used", value=2, unit="", low=3, high=10)
    assert key_figure((lost, camera, projector), "geometry") is lost
    assert key_figure((used, camera)) is used


def test_a_person_judges_by_figures_that_calibrations_have() -> None:
    assert tuple(JUDGED_BY) == recipe_names()
