"""Builds each page from its slice; pages are imported and made when they are first opened."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer

from dsl_app.composition.calibrations import CalibrationInUse
from dsl_app.composition.captures import CapturesAction
from dsl_app.composition.dialogs import ImportAction, ReconstructAgainAction
from dsl_app.composition.first_connection import FirstConnection
from dsl_app.composition.rig_profiles import ProfileAction
from dsl_app.connection.state import Link, RigChoice, RigState
from dsl_app.shared.evented import Value, follow_any
from dsl_app.shared.known_files import Kind
from dsl_app.shared.paths import is_dir
from dsl_app.shared.settings import demo_folder
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shell.application import make_window, open_first_page
from dsl_app.shell.main_window import MainWindow
from dsl_app.shell.warm_up import PAGE_MODULES

if TYPE_CHECKING:
    from dsl_app.calibrate.wizard.controller import WizardController
    from dsl_app.calibrate.wizard.state import WizardState
    from dsl_app.composition.demo import DemoController
    from dsl_app.connection.controller import RigController
    from dsl_app.rig.controller import LiveController
    from dsl_app.rig.projector_screens import ProjectorScreens
    from dsl_app.scan.controller import ScanController
    from dsl_app.session.restore import SessionRestore
    from dsl_core.devices.base import Projector


#: How long the first page is on screen before the rig is connected, ms.
CONNECT_AFTER_MS = 200
#: How long the tour is offered, s: who works by then needs the room.
TOUR_STAYS_S = 20.0


@dataclass(frozen=True)
class StartOptions:
    """What the command line requested; None leaves it to the settings."""

    rig: RigChoice | None = None
    open: Path | None = None
    demo: bool = False
    #: Whether accuracy against time is predicted unasked, a minute or two of computing for each new rig.
    predicts: bool = False
    #: Whether to offer the tour at the first start.
    offers_tour: bool = False


class Composition(QObject):
    """Makes one window, its pages and what they share, and does what needs several of them."""

    window: MainWindow

    def __init__(self, options: StartOptions) -> None:
        super().__init__()
        self._options = options
        #: The controller of the Scan page, once that has been opened.
        self.scans: ScanController | None = None
        #: Whether the result of a scan is being computed.
        self._awaited = Value(False)
        #: The result that the Results page shows.
        self._open_result: Value[Path | None] = Value(None)

    def open_window(
        self, folder: Path | None = None, theme: str | None = None, in_background: bool = False
    ) -> MainWindow:
        """Make the window with its settings of a folder (default: the system's) and the page opened last.

        ``in_background`` imports that page in a thread once the window is painted.
        """
        self.window = make_window(self.pages, folder, theme, self.commands, self.handlers)
        if self._options.demo:
            # Where its result is shown: no other page is imported and made before.
            self.window.parts.settings.page = "results"
        open_first_page(self.window, PAGE_MODULES if in_background else None)
        return self.window

    @property
    def pages(self) -> dict[str, Callable[[], PageWidget]]:
        """Makers of all pages by key."""
        return {
            "start": self._start_page,
            "rig": self._rig_page,
            "calibrate": self._calibrate_page,
            "scan": self._scan_page,
            "results": self._results_page,
            "compare": self._compare_page,
        }

    @property
    def handlers(self) -> dict[Kind, Callable[[Path], object]]:
        """What opens files and folders that no page opens, by kind."""
        return {
            Kind.PUBLISHED: lambda path: self.importer.look(path),
            Kind.PICTURES: lambda path: self.importer.look(path),
        }

    @property
    def commands(self) -> dict[str, Callable[[], object]]:
        """Actions that need several pages, by key."""
        return {
            "demo": lambda: self.demo.show(),
            "live_demo": lambda: self.demo.scan_live(),
            "import": lambda: self.importer.begin(),
            "reconstruct_again": lambda: self.reconstruct_again.begin(),
        }

    def is_awaited(self) -> bool:
        """Whether a person waits for a job, a result, the rig or its first picture; any thread may ask."""
        if any(not job.is_minor for job in self.window.parts.runner.active):
            return True
        # Asking must make neither.
        made = vars(self)
        results = self.session.results if "session" in made else None
        if results is not None and results.is_reading:
            return True
        is_opening = "rig" in made and self.rig.state.link.value is Link.OPENING
        return is_opening or ("live" in made and self.live.state.is_exposing.value)

    def start(self) -> None:
        """Open what was requested, and soon connect the rig, once the window is on screen."""
        if self._options.demo:
            self.demo.show()
        QTimer.singleShot(CONNECT_AFTER_MS, self, self._start_now)

    def _start_now(self) -> None:
        self.session.start()
        FirstConnection(self.window, self.rig).begin(self._options.rig is not None)
        if self._options.open is not None:
            self.window.open_path(self._options.open)
        if self._options.offers_tour and not self.window.parts.settings.tour_seen:
            # Offered once; the Help menu always has it.
            self.window.parts.settings.tour_seen = True
            self.window.save_early()
            self.window.toasts.offer(
                "New here? The guided tour shows the window in seven steps. It is also in the Help menu.",
                {"Take the tour": lambda: self.window.do("tour")},
                TOUR_STAYS_S,
            )

    # What several pages share ----------------------------------------------------------------------

    @cached_property
    def rig(self) -> RigController:
        """The one rig of the application."""
        from dsl_app.connection.controller import RigController
        from dsl_app.rig.projector_window import ScreenProjector

        window, settings = self.window, self.window.parts.settings
        remembered = RigChoice(settings.rig, tuple(settings.rig_options.items()))
        state = RigState(self._options.rig or remembered)
        state.choice.changed.connect(self._remember_rig)
        screens, projector_window = self.screens, self.screens.projector_window
        state.used_by.changed.connect(lambda _: screens.hide_names())

        def wrap(own: Projector) -> Projector:
            return ScreenProjector(projector_window, own)

        return RigController(state, window.parts.runner, window.toasts, wrap)

    def _remember_rig(self, choice: RigChoice) -> None:
        settings = self.window.parts.settings
        settings.rig, settings.rig_options = choice.name, dict(choice.options)
        self.window.save_early()

    @cached_property
    def screens(self) -> ProjectorScreens:
        """The screens that the projector may be."""
        from dsl_app.rig.projector_screens import ProjectorScreens

        screens = ProjectorScreens(self.window, self.window.toasts)
        self.window.closed.connect(screens.close)
        return screens

    @cached_property
    def live(self) -> LiveController:
        """Live view and trial pictures of the rig."""
        from dsl_app.rig.controller import LiveController

        return LiveController(self.rig, self.window.toasts)

    @cached_property
    def demo(self) -> DemoController:
        """The demo of the application."""
        from dsl_app.composition.demo import PRESENTED, DemoController

        parts, toasts = self.window.parts, self.window.toasts
        self.window.opened.connect(lambda page: None if page == "results" else toasts.withdraw(PRESENTED))
        return DemoController(
            demo_folder(), self.rig, parts.runner, toasts, self._show_result, self._open_scan_page
        )

    def _show_result(self, path: Path) -> None:
        self.window.open_page("results")
        self.window.open_path(path)

    def _end_demo(self, opened: Path) -> None:
        """Take back what is said of a finished scan once a person opens another."""
        from dsl_app.composition.demo import PRESENTED

        if opened.parent != demo_folder():
            self.window.toasts.withdraw(PRESENTED)

    def _open_scan_page(self) -> ScanController:
        self.window.open_page("scan")
        assert self.scans is not None
        return self.scans

    @cached_property
    def session(self) -> SessionRestore:
        """Saves the session of the window, and restores one after a crash."""
        from dsl_app.session.restore import SessionRestore

        return SessionRestore(self.window)

    @cached_property
    def calibration_in_use(self) -> CalibrationInUse:
        """The calibration that scans use."""
        return CalibrationInUse(self.window.parts.settings, self.window.toasts, self.window.save_early)

    @cached_property
    def reconstruct_again(self) -> ReconstructAgainAction:
        """Reconstructs scans again."""
        return ReconstructAgainAction(self.window)

    @cached_property
    def importer(self) -> ImportAction:
        """Imports folders of other programs."""
        return ImportAction(self.window, CapturesAction(self.window))

    # Pages -----------------------------------------------------------------------------------------

    def _start_page(self) -> PageWidget:
        from dsl_app.start.page import StartPage
        from dsl_app.start.unfinished import UnfinishedController

        window = self.window
        return StartPage(
            window.parts.recent,
            window.open_path,
            lambda key: self.demo.show(key),
            self._start_live,
            self._choose_rig,
            lambda: window.do("open"),
            lambda: window.do("import"),
            UnfinishedController(
                self._scan_folders, window.parts.runner, window.open_path, self.session.is_offered
            ),
        )

    def _scan_folders(self) -> list[Path]:
        """Where scans are saved, and where recent files are."""
        settings = self.window.parts.settings
        own = settings.scans
        return [own, *(Path(each).parent for each in settings.recent)]

    def _start_live(self) -> None:
        """Show what the simulated rig's camera sees; connects it unless a rig is connected."""
        self.window.open_page("rig")
        if self.rig.state.link.value not in (Link.OPEN, Link.OPENING):
            self.rig.connect(self.rig.state.choice.value)
        self.live.begin_when_open()

    def _choose_rig(self) -> None:
        """Show the rigs; where there are none but those of this program, begin with one of one's own."""
        from dsl_app.rig.page import RigPage
        from dsl_core.devices.registry import is_built_in, rig_names

        page = self.window.open_page("rig")
        if isinstance(page, RigPage) and all(map(is_built_in, rig_names())):
            page.profile_requested.emit("")

    def _rig_page(self) -> PageWidget:
        from dsl_app.rig.page import RigPage
        from dsl_app.rig.traits import TraitsReader
        from dsl_core.devices.registry import rig_names

        parts = self.window.parts
        # Settings always hold what the other pages chose last.
        traits = TraitsReader(self.rig.state, parts.runner, lambda: parts.settings.calibration)
        page = RigPage(self.live, rig_names(), traits)
        self.screens.serve(page)
        profiles = ProfileAction(self.window, self.rig.state, page.offer_rig)
        # The signal would not keep the action.
        page.profile_requested.connect(lambda name: profiles.edit(name))
        page.selftest_requested.connect(lambda: self.window.do("calibrate_selftest"))
        page.scan_requested.connect(lambda: self.window.open_page("scan"))
        return page

    def _calibrate_page(self) -> PageWidget:
        from dsl_app.calibrate.campaign_status import Kinds
        from dsl_app.calibrate.controller import CalibrateController
        from dsl_app.calibrate.page import CalibratePage
        from dsl_app.calibrate.state import CalibrateState, CampaignFacts

        window, settings, state = self.window, self.window.parts.settings, CalibrateState()
        state.in_use.set(settings.calibration)
        kinds = Kinds(ageing_days=settings.ageing_days)
        control = CalibrateController(state, self.rig, window.parts.runner, window.toasts, kinds=kinds)
        control.wizard_ready.connect(lambda pair: self._open_wizard(*pair))
        self.calibration_in_use.serve_library(state)
        last = Path(settings.campaign)
        if settings.campaign and is_dir(last):
            control.open_campaign(last)

        def remember(facts: CampaignFacts | None) -> None:
            if facts is not None:
                settings.campaign, settings.campaigns_folder = str(facts.path), str(facts.path.parent)
                # A campaign takes hours, in which a computer may lose its power.
                window.save_early()

        state.campaign.changed.connect(remember)
        home = settings.campaigns
        page = CalibratePage(state, self.rig.state, control, home)
        page.scan_requested.connect(lambda: window.open_page("scan"))
        return page

    def _open_wizard(self, state: WizardState, control: WizardController) -> None:
        from dsl_app.calibrate.wizard.window import CalibrationWizard

        CalibrationWizard(state, control, self.window.theme, self.window).open()

    def _scan_page(self) -> PageWidget:
        from dsl_app.composition.scan_page import ScanPageMaker

        page, self.scans = ScanPageMaker(
            self.window,
            self.rig,
            self.session,
            self.calibration_in_use,
            self._awaited,
            self._options.predicts,
        ).make()
        return page

    def _results_page(self) -> PageWidget:
        from dsl_app.results.controller import ResultsController
        from dsl_app.results.page import ResultsPage
        from dsl_app.results.state import ResultsState
        from dsl_app.results.welcome import Welcome

        window, parts, state = self.window, self.window.parts, ResultsState()
        controller = ResultsController(state, parts.runner, window.toasts, parts.undo)
        controller.opened.connect(lambda result: self._end_demo(result.path))
        welcome = Welcome(parts.recent, window.open_path, lambda: self.demo.show(), self._awaited)
        self.session.results = controller

        def offer_to_compare() -> None:
            shown = state.saved_result
            self._open_result.set(None if shown is None else shown.path)

        follow_any(offer_to_compare, state.result, state.is_begun)
        page = ResultsPage(state, controller, parts.runner, welcome)
        page.open_chosen.connect(window.open_path)
        page.reconstruct_again_requested.connect(lambda: window.do("reconstruct_again"))
        return page

    def _compare_page(self) -> PageWidget:
        from dsl_app.compare.page import ComparePage
        from dsl_app.compare.pair.controller import PairController
        from dsl_app.compare.pair.state import PairState
        from dsl_app.compare.series.controller import SeriesController
        from dsl_app.compare.series.state import SeriesState

        parts, toasts = self.window.parts, self.window.toasts
        state, series_state = PairState(), SeriesState()
        controller = PairController(state, parts.runner, toasts)
        series = SeriesController(series_state, parts.runner, toasts, parts.undo)
        self.session.pair, self.session.series = controller, series
        self._open_result.follow(state.at_hand.set)
        return ComparePage(state, controller, series_state, series, parts.recent)
