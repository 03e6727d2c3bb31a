"""Every wizard, on each kind of its pages."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

from dsl_app.calibrate.evidence.charts import ChartBox
from dsl_app.calibrate.evidence.selftest import READING
from dsl_app.calibrate.page import CalibratePage
from dsl_app.calibrate.state import ABOUT
from dsl_app.calibrate.wizard.state import Doing, WizardState
from dsl_app.calibrate.wizard.window import CalibrationWizard
from PySide6.QtWidgets import QLineEdit

from dsl_core.io.campaign_folder import CampaignFolder
from tests.cases.tiny_campaign import with_options
from tests.screens.calibrate_scenes import open_campaign
from tests.screens.stage import Stage


class Wizard:
    """A wizard that is open, and what a person does in it."""

    def __init__(self, stage: Stage, name: str, campaign: Path) -> None:
        page: CalibratePage = open_campaign(stage, campaign)
        self._open(stage, page, name)

    @classmethod
    def again(cls, stage: Stage, name: str) -> Wizard:
        """Open a wizard of the campaign that is open."""
        page = stage.window.page_of("calibrate")
        assert isinstance(page, CalibratePage)
        made = cls.__new__(cls)
        made._open(stage, page, name)
        return made

    def _open(self, stage: Stage, page: CalibratePage, name: str) -> None:
        self.stage = stage
        stage.click(page.rows[name].run)
        self.window = stage.dialog(CalibrationWizard)
        self.state: WizardState = self.window._state

    def press(self, text: str) -> None:
        """Press a button of the wizard."""
        self.stage.press(text, self.window)

    def idle(self) -> None:
        """Wait until nothing goes on."""
        self.stage.wait(lambda: self.state.doing.value is Doing.IDLE)

    def drawn(self) -> None:
        """Wait until the evidence is read and every chart has had its turn."""

        def is_drawn() -> bool:
            boxes = [box for box in self.window.findChildren(ChartBox) if box.isVisible()]
            return not any(
                box._draw or (box.sentence.isVisible() and box.sentence.text() == READING) for box in boxes
            )

        self.stage.settle()
        self.stage.wait(is_drawn)

    def go_to(self, page: int) -> None:
        """Click a page in the list at the left, where that of the settings is the last."""
        rows = self.window.steps.count()
        self.window.steps.setCurrentRow((page - 1) % rows)
        self.stage.wait(lambda: self.state.at.value == page)
        self.idle()

    def stop(self) -> None:
        """Stop a capture or fit and wait for its end."""
        if self.state.doing.value.is_long:
            self.press("Stop")
        self.idle()


def calibrated(name: str, stage: Stage) -> None:
    """A calibration that was accepted: its evidence, its settings, a look at a step, a capture anew."""
    wizard = Wizard(stage, name, stage.material.complete)
    wizard.idle()
    wizard.drawn()
    stage.shoot("accepted")
    wizard.go_to(0)
    stage.shoot("settings")
    wizard.go_to(1)
    wizard.press("Check")
    stage.wait(lambda: wizard.state.look.value is not None)
    wizard.press("Check")
    wizard.idle()
    wizard.window._commands.take_news()
    stage.shoot("look")
    wizard.press("Redo this step")
    stage.wait(lambda: wizard.state.progress.value.done > 0 or not wizard.state.doing.value.is_long)
    stage.shoot("capture")
    wizard.stop()


def fresh(stage: Stage) -> None:
    """The next calibration of a campaign: a step that was never captured, and a fit that lacks it."""
    wizard = Wizard(stage, "spectralon", stage.material.half)
    stage.shoot("place")
    wizard.press("Capture all")
    stage.wait(lambda: wizard.state.doing.value is Doing.CAPTURING)
    stage.shoot("all")
    stage.wait(lambda: wizard.state.fit.value is not None)
    wizard.idle()
    wizard.drawn()
    stage.shoot("judge")
    wizard.press("Accept")
    stage.wait(lambda: "The rig is saved" in wizard.state.note.value)
    stage.shoot("accepted")


def lacking(stage: Stage) -> None:
    """The page of the fit before everything is captured, and a setting that makes no sense."""
    wizard = Wizard(stage, "spectralon", stage.material.half)
    wizard.go_to(wizard.state.last)
    stage.shoot("fit")
    wizard.go_to(0)
    field = wizard.window.settings.findChildren(QLineEdit)[0]
    field.setText("many")
    field.editingFinished.emit()
    stage.wait(lambda: wizard.state.settings_trouble.value)
    wizard.idle()
    stage.shoot("setting")


def refused(stage: Stage) -> None:
    """A target that is not there: the look says so, and so does the capture of all steps."""
    campaign = stage.copied(stage.material.half)
    with_options(campaign, {"target_missing": "on"})
    _forget(campaign, "geometry")
    wizard = Wizard(stage, "geometry", stage.material.half)
    wizard.go_to(1)
    wizard.window._commands.check(True)
    stage.wait(lambda: wizard.state.look.value is not None)
    wizard.press("Check")
    wizard.idle()
    wizard.window._commands.take_news()
    stage.shoot("look")
    wizard.press("Capture all")
    stage.wait(lambda: wizard.state.trouble.value)
    stage.shoot("capture")


def by_hand(stage: Stage) -> None:
    """A board that a person brings into its outline: elsewhere, then in place, then captured by itself."""
    campaign = stage.copied(stage.material.half)
    _forget(campaign, "geometry")
    wizard = Wizard(stage, "geometry", stage.material.half)
    devices = stage.composition.rig.state.devices.value
    assert devices is not None
    assert devices.place is not None
    statuses = wizard.state.statuses.value
    wizard.stop()
    wizard.window.reject()
    place, devices.place = devices.place, None
    place(statuses[1].step.placement)
    wizard = Wizard.again(stage, "geometry")
    # It looks by itself as soon as it opens.
    stage.shoot("begin")
    stage.wait(lambda: wizard.state.look.value is not None)
    stage.shoot("elsewhere")
    wizard.press("Check")
    wizard.idle()
    place(statuses[0].step.placement)
    wizard.press("Check")
    stage.wait(lambda: bool(wizard.state.covered.value) and wizard.state.look.value is not None)
    stage.shoot("next")
    wizard.press("Check")
    wizard.stop()


def _forget(campaign: Path, name: str) -> None:
    """Take a calibration's captures away."""
    folder = CampaignFolder.open(campaign)
    shutil.rmtree(folder.home(name))
    (campaign / f"{name}.json").unlink()


def leaving(stage: Stage) -> None:
    """The question before a capture is left."""
    wizard = Wizard(stage, "geometry", stage.material.complete)
    wizard.go_to(1)
    wizard.press("Redo this step")
    stage.wait(lambda: wizard.state.doing.value is Doing.CAPTURING)
    stage.shoot_question("", lambda: wizard.press("Leave"))
    wizard.stop()


SCENES: dict[str, Callable[[Stage], None]] = {
    **{f"wizard-{name}": partial(calibrated, name) for name in ABOUT},
    "wizard-fresh": fresh,
    "wizard-lacking": lacking,
    "wizard-refused": refused,
    "wizard-by-hand": by_hand,
    "wizard-leaving": leaving,
}
