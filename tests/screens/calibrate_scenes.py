"""The Calibrate page and its library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from dsl_app.calibrate.library_panel import DriftWindow
from dsl_app.calibrate.page import CalibratePage
from dsl_app.calibrate.state import DriftVerdict
from dsl_app.connection.state import RigChoice

from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.figure import Figure
from tests.screens.stage import CHART_RIG, Stage


def rig_of(campaign: Path) -> RigChoice:
    """The rig that a campaign was begun with."""
    info = CampaignFolder.open(campaign).info
    return RigChoice(info.rig, tuple(info.options.items()))


def open_campaign(stage: Stage, material: Path, library: bool = False) -> CalibratePage:
    """The page with a copy of a campaign and its rig."""
    campaign = stage.copied(material)
    stage.open(library=library, campaign=campaign)
    stage.connect(rig_of(campaign))
    page = stage.window.open_page("calibrate")
    # The library is made when it is first painted, and read then.
    stage.settle()
    stage.idle()
    assert isinstance(page, CalibratePage)
    return page


def empty(stage: Stage) -> None:
    """No campaign yet, nothing in the library."""
    stage.open()
    page = stage.window.open_page("calibrate")
    stage.shoot()
    stage.connect()
    assert isinstance(page, CalibratePage)
    stage.shoot_question("new", page.head.ask_new)
    page.head._commands.begin_campaign(stage.folder / "campaigns" / "room-12")
    stage.idle()
    stage.shoot("begun")


def half(stage: Stage) -> None:
    """Some accepted, one begun, the rest to come."""
    open_campaign(stage, stage.material.half)
    stage.shoot()


def complete(stage: Stage) -> None:
    """Everything accepted and kept in the library, in several versions."""
    page = open_campaign(stage, stage.material.complete, library=True)
    stage.shoot()
    stage.press("Use for scans", page)
    stage.shoot("in-use")


def drift(stage: Stage) -> None:
    """What a quick shot says of a calibration."""
    page = open_campaign(stage, stage.material.complete, library=True)
    stage.press("Check for drift…", page)
    stage.dialog(DriftWindow)
    stage.shoot()


def drift_missed(stage: Stage) -> None:
    """A quick shot that says that something moved, taken although the gain was another."""
    page = open_campaign(stage, stage.material.half)
    moved = Figure(
        name="row drift", value=0.83, std=0.02, unit="px", high=0.15,
        advice="Camera or projector has turned: repeat the geometry calibration.",
    )  # fmt: skip
    bright = Figure(name="white signal, green", value=1.004, std=0.003, unit="", low=0.97, high=1.03)
    page._state.drift.set(
        DriftVerdict("room-12", (moved, bright), overridden=("the camera's gain (dB) was 6 and is 0",))
    )
    stage.dialog(DriftWindow)
    stage.shoot()


def foreign(stage: Stage) -> None:
    """A campaign of another rig than the one that is connected."""
    open_campaign(stage, stage.material.half)
    stage.connect(replace(CHART_RIG, options=(("size", "64x48"),)))
    stage.idle()
    stage.shoot()


SCENES: dict[str, Callable[[Stage], None]] = {
    "calibrate-empty": empty,
    "calibrate-half": half,
    "calibrate-complete": complete,
    "calibrate-drift": drift,
    "calibrate-missed": drift_missed,
    "calibrate-foreign": foreign,
}
