"""The Scan page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from app.controllers.scan import ScanController
from app.panels.scan_page import ScanPage
from app.state.rig import RigChoice
from app.state.scan import Phase, ScanState
from dsl_core.simulation.faults import FaultPlan, with_faults
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
    controller = stage.composition._scans
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
    stage.shoot_question("closing", stage.window.do_quit)
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
    rig = stage.composition.rig(stage.window)
    devices = rig.state.devices.value
    assert devices is not None
    rig.state.devices.set(with_faults(devices, FaultPlan(camera_gone_at=20)))
    stage.press("Start scan", scan.page)
    stage.wait(lambda: scan.state.phase.value is Phase.LOST)
    stage.shoot()


SCENES: dict[str, Callable[[Stage], None]] = {
    "scan-planned": planned,
    "scan-running": running,
    "scan-done": done,
    "scan-lost": lost,
}
