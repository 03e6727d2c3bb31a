"""The Rig page."""

from __future__ import annotations

from collections.abc import Callable

from dsl_app.connection.state import Link, RigChoice
from dsl_app.rig.page import RigPage

from tests.screens.stage import Stage


def disconnected(stage: Stage) -> None:
    """As it comes up before a rig answers."""
    stage.open(page="rig")
    stage.shoot()


def live(stage: Stage) -> None:
    """Connected, with frames that come in while the projector shows a field."""
    stage.open(page="rig")
    stage.connect()
    stage.shoot("connected")
    rig = stage.composition.live
    rig.show("white", 0.8)
    rig.set_exposure(20.0)
    stage.press("Start live view")
    stage.wait(lambda: rig.state.counts.value.shown > 3)
    page = stage.window.page_of("rig")
    assert isinstance(page, RigPage)
    stage.shoot("picture")
    rig.set_exposure(60.0)
    count = rig.state.counts.value.shown
    stage.wait(lambda: rig.state.counts.value.shown > count + 3)
    stage.shoot("saturated")


def refused(stage: Stage) -> None:
    """A rig with options that make no sense."""
    stage.open(page="rig")
    rig = stage.composition.rig
    rig.connect(RigChoice("twin", (("scene", "chart"), ("size", "huge"))))
    stage.wait(lambda: rig.state.link.value is Link.CLOSED)
    stage.shoot()


SCENES: dict[str, Callable[[Stage], None]] = {
    "rig-disconnected": disconnected,
    "rig-live": live,
    "rig-refused": refused,
}
