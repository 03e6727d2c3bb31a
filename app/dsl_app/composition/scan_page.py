"""Makes the Scan page: its plan, its forecast and effects, and what the settings remember of scans."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.composition.calibrations import CalibrationInUse
from dsl_app.connection.controller import RigController
from dsl_app.scan.command_line import fresh_target
from dsl_app.scan.controller import ScanController
from dsl_app.scan.effects.controller import EffectsController
from dsl_app.scan.effects.state import EffectsState
from dsl_app.scan.forecast.controller import ForecastController
from dsl_app.scan.forecast.panel import ForecastPanel
from dsl_app.scan.forecast.state import ForecastState
from dsl_app.scan.page import ScanPage
from dsl_app.scan.reconstruction_time import Pace
from dsl_app.scan.state import Phase, ScanState
from dsl_app.shared.evented import Value
from dsl_app.shared.settings import data_folder, demo_folder
from dsl_app.shell.main_window import MainWindow
from dsl_core.model.plan import CapturePlan, Sentinels

if TYPE_CHECKING:
    from dsl_app.session.restore import SessionRestore


@dataclass(frozen=True)
class ScanPageMaker:
    """What the Scan page is made of; ``awaited`` is whether a scan's result is being computed.

    With ``predicts`` accuracy against time is predicted unasked.
    """

    window: MainWindow
    rig: RigController
    session: SessionRestore
    calibration: CalibrationInUse
    awaited: Value[bool]
    predicts: bool

    def make(self) -> tuple[ScanPage, ScanController]:
        """The page and its controller."""
        window, parts, rig = self.window, self.window.parts, self.rig
        folder = parts.settings.scans
        state = ScanState(CapturePlan(sentinels=Sentinels()), fresh_target(folder, datetime.now()))
        self._follow(state)
        controller = ScanController(
            state, rig, parts.runner, window.toasts, parts.undo, hidden=demo_folder(), pace=self._pace()
        )
        self.calibration.serve_scans(controller)
        self.session.scans = controller
        foreseen, kept = ForecastState(), data_folder() / "forecasts"
        forecast = ForecastController(
            foreseen, state, rig.state, controller.plans, parts.runner, window.toasts, kept, self.predicts
        )
        rendered = EffectsState()
        effects = EffectsController(rendered, state, rig, parts.runner, window.toasts)
        panel = ForecastPanel(foreseen, forecast)
        page = ScanPage(state, controller, panel, rendered, effects, window.open_path, self._awaits_result)
        page.reconstruct_requested.connect(lambda: window.do("reconstruct_again"))
        return page, controller

    def _follow(self, state: ScanState) -> None:
        """Remember where scans are saved, and show the page where it is wanted."""

        def phase_changed(phase: Phase) -> None:
            if phase is Phase.DONE:
                self._remember_folder(state.target.value.parent)
            elif phase is Phase.RUNNING:
                self.session.scan_began()

        state.phase.changed.connect(phase_changed)
        state.finished.changed.connect(self._remember_scan)
        state.is_reconstructing.changed.connect(self.awaited.set)
        state.wanted.connect(lambda _: self.window.open_page("scan"))

    def _pace(self) -> Pace:
        """How fast this computer reconstructs, kept between sessions."""
        settings = self.window.parts.settings

        def keep(pace: float) -> None:
            settings.reconstruction_pace = pace

        return Pace(settings.reconstruction_pace, keep)

    def _awaits_result(self) -> bool:
        """Whether the Results page is open and has nothing to show."""
        if self.window.page != "results":
            return False
        page = self.window.page_of("results")
        return page.subject() is None and not page.is_reading

    def _remember_folder(self, folder: Path) -> None:
        if folder != demo_folder():
            self.window.parts.settings.output_folder = str(folder)

    def _remember_scan(self, finished: Path | None) -> None:
        """List a scan as recent once its frames are complete: its result may fail, or not be wanted yet."""
        if finished is not None and finished.parent != demo_folder():
            self.window.parts.recent.add(finished)
