"""Saves what is open while the window lives, and offers to restore it after a crash."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject

from dsl_app.session.records import Session
from dsl_app.session.store import SessionStore
from dsl_app.shared.evented import Value
from dsl_app.shared.paths import there
from dsl_app.shared.widgets.ticker import Ticker
from dsl_app.shell.main_window import MainWindow

if TYPE_CHECKING:
    from dsl_app.compare.pair.controller import PairController
    from dsl_app.compare.series.controller import SeriesController
    from dsl_app.results.controller import ResultsController
    from dsl_app.scan.controller import ScanController

#: Interval between two saves of what has changed, ms.
SAVE_MS = 1000


class SessionRestore(QObject):
    """Saves and restores what the pages show; each page that is made registers its controller here."""

    def __init__(self, window: MainWindow) -> None:
        super().__init__(window)
        self._window = window
        #: Whether a session is offered, which is then what a person does next.
        self.is_offered = Value(False)
        self._offered: Session | None = None
        self.results: ResultsController | None = None
        self.scans: ScanController | None = None
        self.pair: PairController | None = None
        self.series: SeriesController | None = None
        # A disk that is busy takes a tenth of a second, for which the window would stand still.
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="session")
        folder = window.parts.settings_path.parent / "sessions"
        self.store = SessionStore(folder, self.collect, writer=self._writer)
        self._timer = Ticker(self, SAVE_MS, self.save)

    # Save ------------------------------------------------------------------------------------------

    def collect(self) -> Session:
        """What is open now."""
        page, pages = self._window.page, (self.results, self.scans, self.pair, self.series)
        if not any(pages):
            # The import below needs all slices.
            return Session(page=page)
        from dsl_app.session.parts import compare_part, results_part, scan_part, series_part

        return Session(
            page=page,
            results=None if self.results is None else results_part(self.results.state),
            scan=None if self.scans is None else scan_part(self.scans.state),
            compare=None if self.pair is None else compare_part(self.pair.state),
            series=None if self.series is None else series_part(self.series.state),
        )

    def save(self) -> None:
        """Write what changed."""
        trouble = self.store.save()
        if trouble:
            self._window.toasts.tell("warning", trouble)

    def start(self) -> None:
        """Offer to restore what was open at a crash, once; then save what is open until the window closes."""
        session, trouble = self.store.crashed_session()
        if trouble:
            self._window.toasts.tell("warning", trouble)
        if session is not None:
            self.is_offered.set(True)
            self._offered = session
            self._window.toasts.offer_next(
                session.offer,
                {"Restore session": lambda: self.restore(session)},
                lambda: self.is_offered.set(False),
            )
            self._window.opened.connect(lambda _: self._be_calm(session))
        self._timer.start()
        self._window.closed.connect(self._end)

    def _be_calm(self, session: Session) -> None:
        """A page that is opened has a blue button of its own."""
        self.is_offered.set(False)
        self._window.toasts.be_calm(session.offer)

    def scan_began(self) -> None:
        """A scan was begun or resumed: offer a plan no longer, if nothing else was open."""
        if self._offered is not None and self._offered.is_a_plan:
            self._window.toasts.withdraw(self._offered.offer)

    def _end(self) -> None:
        self._timer.stop()
        self.store.remove()
        self._writer.shutdown()

    # Restore ---------------------------------------------------------------------------------------

    def restore(self, session: Session) -> None:
        """Open again what a session holds; a message names what no longer exists."""
        from dsl_app.compare.page import ComparePage
        from dsl_app.session import parts

        window = self._window
        if session.results is not None:
            window.page_of("results")
            assert self.results is not None
            if not there(session.results.path):
                window.open_path(session.results.path)
            else:
                parts.restore_result(session.results, self.results)
        if session.scan is not None:
            window.page_of("scan")
            assert self.scans is not None
            parts.restore_scan(session.scan, self.scans)
        if session.compare is not None:
            window.page_of("compare")
            assert self.pair is not None
            parts.restore_comparison(session.compare, self.pair)
        if session.series is not None:
            page = window.page_of("compare")
            assert self.series is not None
            parts.restore_series(session.series, self.series)
            if session.compare is None:
                assert isinstance(page, ComparePage)
                page.show_series()
        window.open_page(session.page)
