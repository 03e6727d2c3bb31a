"""Which page gets which controller and state; pages are imported when they are first opened."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer
from PySide6.QtGui import QGuiApplication

from app.controllers.rig import RigController
from app.main_window import MainWindow, PageMaker
from app.projector_window import ProjectorWindow, ScreenLabel, ScreenProjector, describe_screen
from app.state.rig import Link, RigChoice, RigState
from app.widgets.page import PageWidget
from dsl_core.errors import DslError

if TYPE_CHECKING:
    from app.panels.rig_page import RigPage
    from app.state.scan import ScanState

_log = logging.getLogger(__name__)
IDENTIFY_MS = 3000
#: How long the window is on screen before the rig is asked for, ms.
CONNECT_AFTER_MS = 200


@dataclass(frozen=True)
class Wish:
    """What the command line asked for; None leaves it to the settings."""

    rig: RigChoice | None = None
    open: Path | None = None


class Composition(QObject):
    """Makes the pages of one window and what they share: the rig and the projector's screen."""

    def __init__(self, wish: Wish) -> None:
        super().__init__()
        self._wish = wish
        self._rig: RigController | None = None
        self._screen: ProjectorWindow | None = None
        self._labels: list[ScreenLabel] = []

    @property
    def pages(self) -> dict[str, PageMaker]:
        """Makers of all pages by key."""
        return {
            "rig": self._rig_page,
            "scan": self._scan_page,
            "results": self._results_page,
            "compare": self._compare_page,
        }

    def start(self, window: MainWindow) -> None:
        """Connect the rig and open what was asked for, once the window is on screen."""
        QTimer.singleShot(CONNECT_AFTER_MS, self, lambda: self._begin(window))

    def _begin(self, window: MainWindow) -> None:
        rig = self.rig(window)
        if rig.state.link.value is Link.CLOSED:
            rig.connect(rig.state.choice.value)
        if self._wish.open is not None:
            window.open_path(self._wish.open)

    def rig(self, window: MainWindow) -> RigController:
        """The one rig of the application."""
        if self._rig is None:
            settings = window.parts.settings
            remembered = RigChoice(settings.rig, tuple(settings.rig_options.items()))
            state = RigState(self._wish.rig or remembered)
            state.choice.changed.connect(lambda choice: _remember(window, choice))
            screen = self._projector_window(window)
            self._rig = RigController(
                state, window.parts.runner, window.toasts, lambda own: ScreenProjector(screen, own)
            )
        return self._rig

    # Pages -----------------------------------------------------------------------------------------

    def _rig_page(self, window: MainWindow) -> PageWidget:
        from app.panels.rig_page import RigPage
        from dsl_core.devices.registry import rig_names

        rig = self.rig(window)
        page = RigPage(rig.state, rig, rig_names())
        page.projector.identify.connect(self._identify)
        page.projector.screen_chosen.connect(lambda name: self._choose_screen(window, page, name))
        application = QGuiApplication.instance()
        assert isinstance(application, QGuiApplication)
        for signal in (application.screenAdded, application.screenRemoved):
            signal.connect(lambda _screen: page.projector.refresh_screens(self._armed_screen()))
        page.apply_theme(window.theme)
        return page

    def _scan_page(self, window: MainWindow) -> PageWidget:
        from app.controllers.scan import ScanController
        from app.controllers.scan_words import fresh_target
        from app.panels.scan_page import ScanPage
        from app.state.scan import Phase, ScanState
        from dsl_core.evaluation.operating_points import load_operating_points
        from dsl_core.model.plan import CapturePlan

        parts = window.parts
        folder = Path(parts.settings.output_folder or Path.home() / "dsl-scans")
        state = ScanState(CapturePlan(), fresh_target(folder, datetime.now()))
        state.phase.changed.connect(
            lambda phase: _remember_folder(window, state) if phase is Phase.DONE else None
        )
        controller = ScanController(state, self.rig(window), parts.runner, window.toasts, parts.undo)
        try:
            points = load_operating_points()
        except DslError as error:
            _log.warning("%s", error)
            points = None
        page = ScanPage(state, controller, points, window.open_path)
        page.apply_theme(window.theme)
        return page

    def _results_page(self, window: MainWindow) -> PageWidget:
        from app.controllers.results import ResultsController
        from app.panels.results_page import ResultsPage
        from app.state.results import ResultsState

        parts, state = window.parts, ResultsState()
        controller = ResultsController(state, parts.runner, window.toasts, parts.undo)
        page = ResultsPage(state, controller, parts.runner)
        page.apply_theme(window.theme)
        return page

    def _compare_page(self, window: MainWindow) -> PageWidget:
        from app.controllers.compare import CompareController
        from app.panels.compare_page import ComparePage
        from app.state.compare import CompareState

        state = CompareState()
        page = ComparePage(state, CompareController(state, window.parts.runner, window.toasts))
        page.apply_theme(window.theme)
        return page

    # The projector's screen ------------------------------------------------------------------------

    def _projector_window(self, window: MainWindow) -> ProjectorWindow:
        if self._screen is None:
            self._screen = ProjectorWindow()
            self._screen.lost.connect(
                lambda name: window.toasts.tell(
                    "error",
                    f"The projector's screen {name} is gone. Connect it again and choose it on the Rig page.",
                )
            )
            self._screen.restored.connect(
                lambda name: window.toasts.tell(
                    "info", f"The screen {name} is there again. Choose it on the Rig page to use it."
                )
            )
            window.destroyed.connect(self._screen.close)
        return self._screen

    def _armed_screen(self) -> str:
        screen = self._screen
        return screen.screen().name() if screen is not None and screen.is_armed else ""

    def _choose_screen(self, window: MainWindow, page: RigPage, name: str) -> None:
        beam = self._projector_window(window)
        found = next((s for s in QGuiApplication.screens() if s.name() == name), None)
        try:
            if found is None:
                beam.disarm()
            elif found is window.screen():
                raise DslError(
                    f"{name} is the screen of this window. Choose the projector's, or move this window away."
                )
            else:
                beam.arm(found)
        except DslError as error:
            window.toasts.tell("error", str(error))
        page.projector.refresh_screens(self._armed_screen())

    def _identify(self) -> None:
        self._labels = [ScreenLabel(s, describe_screen(s)) for s in QGuiApplication.screens()]
        for label in self._labels:
            label.show()
            QTimer.singleShot(IDENTIFY_MS, label, label.close)


def _remember(window: MainWindow, choice: RigChoice) -> None:
    window.parts.settings.rig = choice.name
    window.parts.settings.rig_options = dict(choice.options)


def _remember_folder(window: MainWindow, state: ScanState) -> None:
    window.parts.settings.output_folder = str(state.target.value.parent)
