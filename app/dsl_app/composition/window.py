"""Which page gets which controller and state; pages are imported when they are first opened."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer

from dsl_app.composition.calibrations import CalibrationDesk
from dsl_app.composition.imports import TakeInDesk
from dsl_app.composition.reconstruct_again import AgainDesk
from dsl_app.connection.state import Link, RigChoice, RigState
from dsl_app.shared.known_files import Kind
from dsl_app.shared.settings import data_folder
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shell.main_window import Command, MainWindow, PageMaker, Taker, page_commands

if TYPE_CHECKING:
    from dsl_app.composition.demo import DemoController
    from dsl_app.composition.projector_screens import ProjectorScreens
    from dsl_app.composition.session_restore import SessionDesk
    from dsl_app.connection.controller import RigController
    from dsl_app.scan.controller import ScanController
    from dsl_app.scan.state import ScanState


#: What the window does behind any page.
_SHARED = (
    "dsl_app.connection.controller",
    "dsl_app.composition.projector_screens",
    "dsl_app.composition.session_restore",
)
#: What pages are made of; imported by a thread where one is opened first of all.
IMPORTS = {
    "rig": (*_SHARED, "dsl_core.devices.registry", "dsl_app.rig.page"),
    "calibrate": (*_SHARED, "dsl_app.calibrate.controller", "dsl_app.calibrate.page"),
    "scan": (
        *_SHARED,
        "dsl_app.scan.controller",
        "dsl_app.scan.forecast.controller",
        "dsl_app.scan.effects.controller",
        "dsl_app.scan.page",
    ),
    "results": (*_SHARED, "dsl_app.results.controller", "dsl_app.results.page"),
    "compare": (
        *_SHARED,
        "dsl_app.compare.pair.controller",
        "dsl_app.compare.series.controller",
        "dsl_app.compare.page",
    ),
}
#: How long the first page is on screen before the rig is asked for, ms.
CONNECT_AFTER_MS = 200


@dataclass(frozen=True)
class Wish:
    """What the command line asked for; None leaves it to the settings."""

    rig: RigChoice | None = None
    open: Path | None = None
    demo: bool = False
    #: Whether accuracy against time is predicted unasked, a minute or two of computing for each new rig.
    predicts: bool = False
    #: Whether a person sits before the window, who may be offered the tour at the first start.
    is_first_contact: bool = False


class Composition(QObject):
    """Makes the pages of one window and what they share, and does what only all of them together can do."""

    def __init__(self, wish: Wish) -> None:
        super().__init__()
        self._wish = wish
        self._rig: RigController | None = None
        self._screens: ProjectorScreens | None = None
        self._scans: ScanController | None = None
        self._demo: DemoController | None = None
        self._session: SessionDesk | None = None
        self._desk: CalibrationDesk | None = None
        self._again: AgainDesk | None = None
        self._importer: TakeInDesk | None = None

    @property
    def pages(self) -> dict[str, PageMaker]:
        """Makers of all pages by key."""
        return {
            "rig": self._rig_page,
            "calibrate": self._calibrate_page,
            "scan": self._scan_page,
            "results": self._results_page,
            "compare": self._compare_page,
        }

    @property
    def takers(self) -> dict[Kind, Taker]:
        """What takes files and folders that no page opens, by what they are."""
        return {Kind.PUBLISHED: lambda window, path: self.importer(window).look(path)}

    @property
    def commands(self) -> dict[str, Command]:
        """Actions of the whole application, by key."""
        return {
            "demo": lambda window: self.demo(window).show(),
            "live_demo": lambda window: self.demo(window).scan_live(),
            "import": lambda window: self.importer(window).begin(),
            "reconstruct_again": lambda window: self.again(window).begin(),
            **page_commands(),
        }

    def start(self, window: MainWindow) -> None:
        """Connect the rig and open what was asked for, once the window is on screen."""
        QTimer.singleShot(CONNECT_AFTER_MS, self, lambda: self._begin(window))

    def _begin(self, window: MainWindow) -> None:
        self.session(window).start()
        rig = self.rig(window)
        if rig.state.link.value is Link.CLOSED:
            rig.connect(rig.state.choice.value)
        if self._wish.open is not None:
            window.open_path(self._wish.open)
        if self._wish.demo:
            self.demo(window).show()
        if self._wish.is_first_contact and not window.parts.settings.tour_seen:
            # Said once: who closes it finds the tour in the Help menu.
            window.parts.settings.tour_seen = True
            window.toasts.offer(
                "New here? A tour of seven steps shows what is where; Help, Guided tour has it later too.",
                {"Take the tour": lambda: window.do("tour")},
            )

    def rig(self, window: MainWindow) -> RigController:
        """The one rig of the application."""
        if self._rig is None:
            from dsl_app.composition.projector_screens import ProjectorScreens
            from dsl_app.connection.controller import RigController
            from dsl_app.connection.projector_window import ScreenProjector

            settings = window.parts.settings
            remembered = RigChoice(settings.rig, tuple(settings.rig_options.items()))
            state = RigState(self._wish.rig or remembered)
            state.choice.changed.connect(lambda choice: _remember(window, choice))
            self._screens = screens = ProjectorScreens(window)
            state.used_by.changed.connect(lambda _: screens.hide_names())
            self._rig = RigController(
                state, window.parts.runner, window.toasts, lambda own: ScreenProjector(screens.beam, own)
            )
        return self._rig

    def demo(self, window: MainWindow) -> DemoController:
        """The demo of the application."""
        if self._demo is None:
            from dsl_app.composition.demo import DemoController

            self._demo = DemoController(
                _demo_folder(),
                self.rig(window),
                window.parts.runner,
                window.toasts,
                lambda path: self._show_result(window, path),
                lambda: self._open_scan_page(window),
            )
        return self._demo

    @staticmethod
    def _show_result(window: MainWindow, path: Path) -> None:
        window.open_page("results")
        window.open_path(path)

    def session(self, window: MainWindow) -> SessionDesk:
        """What keeps the session of the window."""
        if self._session is None:
            from dsl_app.composition.session_restore import SessionDesk

            self._session = SessionDesk(window)
        return self._session

    def _open_scan_page(self, window: MainWindow) -> ScanController:
        window.open_page("scan")
        assert self._scans is not None
        return self._scans

    def desk(self, window: MainWindow) -> CalibrationDesk:
        """What all calibrations of the application share."""
        if self._desk is None:
            self._desk = CalibrationDesk(window, self.rig(window))
        return self._desk

    def again(self, window: MainWindow) -> AgainDesk:
        """What reconstructs scans again."""
        if self._again is None:
            self._again = AgainDesk(window)
        return self._again

    def importer(self, window: MainWindow) -> TakeInDesk:
        """What imports folders of other programs."""
        if self._importer is None:
            self._importer = TakeInDesk(window)
        return self._importer

    def _calibrate_page(self, window: MainWindow) -> PageWidget:
        return self.desk(window).page()

    # Pages -----------------------------------------------------------------------------------------

    def _rig_page(self, window: MainWindow) -> PageWidget:
        from dsl_app.rig.page import RigPage
        from dsl_core.devices.registry import rig_names

        rig = self.rig(window)
        page = RigPage(rig.state, rig, rig_names())
        assert self._screens is not None
        self._screens.serve(page)
        page.selftest_wanted.connect(lambda: window.do("calibrate_selftest"))
        page.apply_theme(window.theme)
        return page

    def _scan_page(self, window: MainWindow) -> PageWidget:
        from dsl_app.scan.command_line import fresh_target
        from dsl_app.scan.controller import ScanController
        from dsl_app.scan.effects.controller import EffectsController
        from dsl_app.scan.effects.state import EffectsState
        from dsl_app.scan.forecast.controller import ForecastController
        from dsl_app.scan.forecast.panel import ForecastPanel
        from dsl_app.scan.forecast.state import ForecastState
        from dsl_app.scan.page import ScanPage
        from dsl_app.scan.state import Phase, ScanState
        from dsl_core.model.plan import CapturePlan

        parts = window.parts
        folder = Path(parts.settings.output_folder or Path.home() / "dsl-scans")
        state = ScanState(CapturePlan(), fresh_target(folder, datetime.now()))
        state.phase.changed.connect(
            lambda phase: _remember_folder(window, state) if phase is Phase.DONE else None
        )
        self._scans = controller = ScanController(
            state, self.rig(window), parts.runner, window.toasts, parts.undo, hidden=_demo_folder()
        )
        self.desk(window).serve(controller)
        self.session(window).serve_scan(controller)
        foreseen = ForecastState()
        forecast = ForecastController(
            foreseen,
            state,
            self.rig(window).state,
            controller.plans,
            parts.runner,
            window.toasts,
            data_folder() / "forecasts",
            self._wish.predicts,
        )
        rendered = EffectsState()
        effects = EffectsController(rendered, state, self.rig(window), parts.runner, window.toasts)
        page = ScanPage(
            state,
            controller,
            ForecastPanel(foreseen, forecast),
            rendered,
            effects,
            window.open_path,
        )
        page.reconstruct_requested.connect(lambda: window.do("reconstruct_again"))
        page.apply_theme(window.theme)
        return page

    def _results_page(self, window: MainWindow) -> PageWidget:
        from dsl_app.results.controller import ResultsController
        from dsl_app.results.page import ResultsPage
        from dsl_app.results.state import ResultsState
        from dsl_app.results.welcome import Welcome

        parts, state = window.parts, ResultsState()
        controller = ResultsController(state, parts.runner, window.toasts, parts.undo)
        welcome = Welcome(parts.recent, window.open_path, lambda: self.demo(window).show())
        self.session(window).serve_results(controller)
        page = ResultsPage(state, controller, parts.runner, welcome)
        page.open_chosen.connect(window.open_path)
        page.again_wanted.connect(lambda: window.do("reconstruct_again"))
        page.apply_theme(window.theme)
        return page

    def _compare_page(self, window: MainWindow) -> PageWidget:
        from dsl_app.compare.page import ComparePage
        from dsl_app.compare.pair.controller import CompareController
        from dsl_app.compare.pair.state import CompareState
        from dsl_app.compare.series.controller import SeriesController
        from dsl_app.compare.series.state import SeriesState

        parts, state, several = window.parts, CompareState(), SeriesState()
        controller = CompareController(state, parts.runner, window.toasts)
        series = SeriesController(several, parts.runner, window.toasts, parts.undo)
        self.session(window).serve_comparison(controller, series)
        page = ComparePage(state, controller, several, series)
        page.apply_theme(window.theme)
        return page


def _demo_folder() -> Path:
    return data_folder() / "demo"


def _remember(window: MainWindow, choice: RigChoice) -> None:
    window.parts.settings.rig = choice.name
    window.parts.settings.rig_options = dict(choice.options)


def _remember_folder(window: MainWindow, state: ScanState) -> None:
    if state.target.value.parent == _demo_folder():
        return
    window.parts.settings.output_folder = str(state.target.value.parent)
