"""Puts the Calibrate page, its wizards and the scans that use its calibrations together."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.calibrate.state import CampaignFacts
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shell.main_window import MainWindow

if TYPE_CHECKING:
    from dsl_app.calibrate.controller import CalibrateController
    from dsl_app.calibrate.wizard.controller import WizardController
    from dsl_app.calibrate.wizard.state import WizardState
    from dsl_app.connection.controller import RigController
    from dsl_app.scan.controller import ScanController

_log = logging.getLogger(__name__)


class CalibrationDesk:
    """Makes the page when it is first opened, and lets scans use what it keeps."""

    def __init__(self, window: MainWindow, rig: RigController) -> None:
        self._window, self._rig = window, rig
        self._control: CalibrateController | None = None
        self._scans: ScanController | None = None

    def page(self) -> PageWidget:
        """The Calibrate page, with the campaign that was open last."""
        from dsl_app.calibrate.campaign_status import Kinds
        from dsl_app.calibrate.controller import CalibrateController
        from dsl_app.calibrate.page import CalibratePage
        from dsl_app.calibrate.state import CalibrateState

        window, settings = self._window, self._window.parts.settings
        state = CalibrateState()
        state.in_use.set(settings.calibration)
        self._control = control = CalibrateController(
            state,
            self._rig,
            window.parts.runner,
            window.toasts,
            kinds=Kinds(ageing_days=settings.ageing_days),
        )
        control.wizard_ready.connect(lambda pair: self._show(*pair))
        state.in_use.changed.connect(self._use)
        state.library.changed.connect(lambda _: self._use(state.in_use.value))
        last = Path(settings.campaign)
        if settings.campaign and last.is_dir():
            control.open_campaign(last)
        state.campaign.changed.connect(self._remember_campaign)
        home = Path(settings.campaigns_folder or Path.home() / "dsl-campaigns")
        page = CalibratePage(state, self._rig.state, control, home)
        page.apply_theme(window.theme)
        return page

    def _show(self, state: WizardState, control: WizardController) -> None:
        from dsl_app.calibrate.wizard.window import CalibrationWizard

        CalibrationWizard(state, control, self._window.theme, self._window).open()

    def _remember_campaign(self, facts: CampaignFacts | None) -> None:
        if facts is not None:
            settings = self._window.parts.settings
            settings.campaign, settings.campaigns_folder = str(facts.path), str(facts.path.parent)

    # Scans -----------------------------------------------------------------------------------------

    def serve(self, scans: ScanController) -> None:
        """Let scans use the calibration that was chosen, now and from now on."""
        self._scans = scans
        wanted = self._window.parts.settings.calibration
        if wanted:
            self._choose(wanted)
        scans.state.calibration.changed.connect(lambda choice: self._chosen(choice.key))

    def _use(self, key: str) -> None:
        """Scan with a calibration of the library; the Scan page need not be there yet."""
        self._window.parts.settings.calibration = key
        if self._scans is not None and key:
            self._choose(key)

    def _choose(self, key: str) -> None:
        from dsl_app.scan.state import CalibrationChoice
        from dsl_core.io.calibration_library import CalibrationLibrary

        assert self._scans is not None
        if key.partition("@")[0] in CalibrationLibrary().names():
            self._scans.plans.choose_calibration(CalibrationChoice(key, key))
        else:
            _log.warning("The library has no calibration %r any more; scans use the rig's own.", key)

    def _chosen(self, key: str) -> None:
        """Remember what was chosen on the Scan page."""
        self._window.parts.settings.calibration = key
        if self._control is not None:
            self._control.state.in_use.set(key)
