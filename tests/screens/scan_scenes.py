"""The Scan page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from dsl_app.connection.state import RigChoice
from dsl_app.scan.controller import ScanController
from dsl_app.scan.forecast.controller import ForecastController
from dsl_app.scan.forecast.job import usual_candidates
from dsl_app.scan.forecast.state import MeasuredScan
from dsl_app.scan.page import ScanPage
from dsl_app.scan.state import Phase, ScanState

from dsl_core.planning.designed import DesignedSet, packed, save_design
from tests.cases.faults import FaultPlan, with_faults
from tests.screens.stage import CHART_RIG, Stage

#: Takes as long as real devices would, so that a running scan can be looked at.
PATIENT = RigChoice("twin", (*CHART_RIG.options, ("realtime", "on")))


@dataclass
class Scan:
    """The page with its state."""

    page: ScanPage
    state: ScanState
    controller: ScanController


def planned_scan(stage: Stage, rig: RigChoice = CHART_RIG, preset: str = "preview") -> Scan:
    """The page with a rig and a plan."""
    stage.connect(rig)
    page = stage.window.open_page("scan")
    assert isinstance(page, ScanPage)
    stage.idle()
    controller = stage.composition.scans
    assert controller is not None
    controller.plans.choose_preset(preset)
    return Scan(page, page._state, controller)


def planned(stage: Stage) -> None:
    """Ready to start, with the reference plan and with one of one's own."""
    stage.open(library=True)
    page = stage.window.open_page("scan")
    stage.shoot("no-rig")
    scan = planned_scan(stage, preset="reference")
    stage.shoot()
    assert scan.page is page
    scan.page.plan.step.setValue(4)
    stage.shoot("own-plan")


def running(stage: Stage) -> None:
    """Frames come in; a pixel's intensity graph grows; then it is paused."""
    stage.open()
    scan = planned_scan(stage, PATIENT)
    stage.press("Start scan", scan.page)
    stage.wait(lambda: scan.state.status.value.done > 4)
    scan.controller.point_at((60, 40))
    stage.wait(lambda: scan.state.status.value.done > 24)
    stage.shoot()
    stage.press("Pause", scan.page)
    stage.wait(lambda: scan.state.phase.value is Phase.PAUSED)
    stage.shoot("paused")
    stage.shoot_question("closing", lambda: stage.window.do("quit"))
    stage.press("Cancel", scan.page)
    stage.wait(lambda: scan.state.phase.value is Phase.STOPPED)
    stage.shoot("stopped")


def done(stage: Stage) -> None:
    """Every frame is stored."""
    stage.open()
    scan = planned_scan(stage)
    scan.state.then_reconstruct.set(False)
    stage.press("Start scan", scan.page)
    scan.controller.point_at((60, 40))
    stage.wait(lambda: scan.state.phase.value is Phase.DONE)
    stage.shoot()


def lost(stage: Stage) -> None:
    """The camera's cable is pulled in the middle."""
    stage.open()
    scan = planned_scan(stage)
    rig = stage.composition.rig
    devices = rig.state.devices.value
    assert devices is not None
    rig.state.devices.set(with_faults(devices, FaultPlan(camera_gone_at=40)))
    # Frames that measure the scene would be lost before one is saved.
    scan.state.meters.set(False)
    stage.press("Start scan", scan.page)
    stage.wait(lambda: scan.state.phase.value is Phase.LOST)
    stage.shoot()


def forecast(stage: Stage) -> None:
    """What accuracy costs in time: before it is known, a part of the curve, and after a scan."""
    stage.open()
    scan = planned_scan(stage)
    stage.shoot("not-yet")
    control = scan.page.forecast._controller
    assert isinstance(control, ForecastController)
    # Every sixth plan shows what all of them would.
    control._candidates = lambda basis: islice(usual_candidates(basis), 0, None, 6)
    control.begin()
    stage.wait(lambda: len(control.state.points.value) > 2)
    stage.shoot("under-way")
    stage.idle()
    control.answer(budget_s=60)
    stage.shoot()
    scan.page.forecast.curve.content.figure.setCurrentIndex(4)
    stage.shoot("width")
    scan.controller.plans.choose_preset("quick")
    scan.state.then_reconstruct.set(False)
    stage.press("Start scan", scan.page)
    stage.wait(lambda: scan.state.phase.value is Phase.DONE)
    scan.controller.reconstruct(stage.folder / "scans" / f"{_only(control).name}.dsl")
    stage.wait(lambda: _only(control).rmse is not None)
    stage.window.open_page("scan")
    scan.page.middle.setCurrentWidget(scan.page.forecast)
    stage.shoot("afterwards")


def _only(control: ForecastController) -> MeasuredScan:
    found = control.state.measured.value
    assert found is not None
    return found


def designed(stage: Stage) -> None:
    """Patterns of a file, and a file that is no plan."""
    stage.open()
    scan = planned_scan(stage)
    levels = np.zeros((16, 640, 3), np.uint8)
    levels[np.arange(640) // 2 % 16, np.arange(640)] = 255
    made = DesignedSet(
        name="designed 16", rig="twin", command="", frames=16, width_px=640, lines="lines",
        comb_error=0.02, error=0.01, levels=packed(levels),
    )  # fmt: skip
    stage.window.open_path(save_design(made, stage.folder / "set.json"))
    stage.wait(lambda: scan.state.plan.value.name == "designed 16")
    wrong = stage.folder / "wrong.json"
    wrong.write_text('{"spectral": {"kind": "lines", "width_px": 0}}')
    stage.window.open_path(wrong)
    stage.idle()
    stage.shoot()


def no_forecast(stage: Stage) -> None:
    """Nothing can be predicted without a calibration."""
    stage.open()
    planned_scan(stage, replace(CHART_RIG, options=(*CHART_RIG.options, ("truth", "4"))))
    stage.shoot()


def effects(stage: Stage) -> None:
    """What the twin renders, as usual, by what the scene calls for, and by name."""
    stage.open()
    scan = planned_scan(stage)
    panel = scan.page.effects.content
    scan.page.middle.setCurrentWidget(scan.page.effects)
    stage.wait(lambda: panel.table.rowCount() > 0)
    stage.idle()
    stage.shoot()
    panel.choice.setCurrentIndex(panel.choice.findData("auto"))
    stage.idle()
    stage.shoot("auto")
    stage.press("Apply", panel)
    stage.idle()
    panel.choice.setCurrentIndex(panel.choice.findData("chosen"))
    stage.idle()
    stage.shoot("chosen")


SCENES: dict[str, Callable[[Stage], None]] = {
    "scan-planned": planned,
    "scan-forecast": forecast,
    "scan-designed": designed,
    "scan-uncalibrated": no_forecast,
    "scan-effects": effects,
    "scan-running": running,
    "scan-done": done,
    "scan-lost": lost,
}
