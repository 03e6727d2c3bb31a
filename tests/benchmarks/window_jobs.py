"""What a person lets the application do while `bench_window` watches how the window comes round."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from dsl_app.calibrate.state import ABOUT
from dsl_app.calibrate.wizard.state import Doing
from dsl_app.calibrate.wizard.window import CalibrationWizard
from dsl_app.compare.page import ComparePage
from dsl_app.connection.state import Link, RigChoice
from dsl_app.results.page import ResultsPage
from dsl_app.rig.page import RigPage
from dsl_app.scan.controller import ScanController
from dsl_app.scan.page import ScanPage
from dsl_app.scan.state import Phase
from dsl_app.shell.application import collect_garbage
from dsl_app.shell.warm_up import WarmUp

from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.plan import LineComb
from tests.app.support.results_controller import exports
from tests.benchmarks.stall_watch import Stalls, StallWatch
from tests.screens.stage import Stage

#: Large enough that renderings and solvers are heavy, small enough that a busy machine ends in minutes.
SCAN_RIG = RigChoice("twin", (("scene", "color-checker"), ("size", "222x145")))
#: The camera at its full size.
LIVE_RIG = RigChoice("twin", (("scene", "color-checker"),))
LIVE_S = 8.0
#: How long a cloud grows, a step after the other.
GROW_S = 2.0
#: Plans tried one after the other, and for how long each, s.
DRAGS, DRAG_S = 12, 0.2
#: After so long what is captured or exported is cancelled, s: it is in the middle of the work then.
CAPTURE_S, EXPORT_S = 0.15, 0.3
ENDINGS = {"ply": "ply", "envi": "hdr", "exr": "exr", "png": "png"}
#: How long any job may take on a machine that others keep busy, s.
PATIENCE_S = 1800.0


class WindowJobs:
    """The composed application and what is done in it; each job is watched and timed.

    ``full`` is a result of full size.
    """

    def __init__(self, stage: Stage, watch: StallWatch, full: Path) -> None:
        self.stage, self._watch, self._full = stage, watch, full
        self._warm_up = WarmUp()
        #: Stalls and seconds of each job, and seconds until a cancel acted.
        self.stalls: dict[str, Stalls] = {}
        self.seconds: dict[str, float] = {}
        self.cancel_s: dict[str, float] = {}

    def _wait(self, holds: Callable[[], object]) -> None:
        self.stage.wait(holds, PATIENCE_S)

    def _live_for(self, seconds: float) -> None:
        limit = time.monotonic() + seconds
        self._wait(lambda: time.monotonic() > limit)

    @contextmanager
    def _job(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        with self._watch.during(name) as stalls:
            yield
            self.stage.settle()
        self.stalls[name], self.seconds[name] = stalls, time.perf_counter() - start

    def _cancel(self, name: str, stop: Callable[[], object], is_over: Callable[[], object]) -> None:
        with self._job(f"{name}, cancelled"):
            start = time.perf_counter()
            stop()
            self._wait(is_over)
            self.cancel_s[name] = time.perf_counter() - start

    def all(self) -> dict[str, Callable[[], None]]:
        """Groups of jobs by name, in an order that works."""
        calibrations = {name: partial(self._calibrate, name) for name in ABOUT}
        return {
            "start": self._start,
            "live": self._live,
            "scan": self._scan,
            "plan": self._plan,
            **calibrations,
            "results": self._results,
            "export": self._export,
            "compare": self._compare,
        }

    def _start(self) -> None:
        campaign = self.stage.copied(self.stage.material.complete)
        # How long the window takes to the screen is a figure of its own.
        self.stage.open(library=True, page_waits=True, campaign=campaign)
        window = self.stage.window
        with self._job("first page"):
            collect_garbage(window)
            self._wait(lambda: window.stack.count() > 0)
        with self._job("connect at the start"):
            self.stage.composition.start()
            self._warm_up.start()
            rig = self.stage.composition.rig
            self._wait(lambda: rig.state.link.value is Link.OPEN)
        with self._job("at rest after the start"):
            self._wait(lambda: self._warm_up.is_over)
        for page in ("rig", "scan", "calibrate", "results", "compare"):
            with self._job(f"open page {page}"):
                self.stage.window.open_page(page)
        self.stage.idle()

    def _live(self) -> None:
        with self._job("connect full size"):
            self.stage.connect(LIVE_RIG)
        page = self.stage.window.open_page("rig")
        assert isinstance(page, RigPage)
        rig = self.stage.composition.rig
        with self._job("live view full size"):
            self.stage.composition.live.start()
            self._live_for(LIVE_S)
        self._cancel("live view", rig.stop_live, lambda: not rig.state.live.value)
        self.stage.idle()

    # Scan ------------------------------------------------------------------------------------------

    def _scan_page(self) -> tuple[ScanPage, ScanController]:
        page = self.stage.window.open_page("scan")
        assert isinstance(page, ScanPage)
        self.stage.idle()
        control = self.stage.composition.scans
        assert control is not None
        return page, control

    def _scan(self) -> None:
        with self._job("connect"):
            self.stage.connect(SCAN_RIG)
        page, control = self._scan_page()
        state = page._state
        state.then_reconstruct.set(False)
        control.plans.choose_preset("reference")
        control.start()
        with self._job("scan, its first frames"):
            self._wait(lambda: state.status.value.done > 8)
        self._cancel("scan", control.cancel, lambda: state.phase.value is Phase.STOPPED)
        control.plan_new_scan()
        control.plans.choose_preset("preview")
        control.point_at((60, 40))
        with self._job("scan"):
            self.stage.press("Start scan", page)
            self._wait(lambda: state.phase.value is Phase.DONE)
            self.stage.idle()
        self._reconstruct(_latest(state.target.value))

    def _plan(self) -> None:
        """Predict for plans that are dragged about, then weigh effects while a person chooses."""
        self.stage.connect(SCAN_RIG)
        page, control = self._scan_page()
        forecast = page.forecast
        page.middle.setCurrentWidget(forecast)
        control.plans.choose_preset("reference")
        forecast._controller.begin()
        known = forecast._state.points
        with self._job("predict while a plan is dragged"):
            for period_px in range(60, 60 + 2 * DRAGS, 2):
                spectral = LineComb(period_px=period_px)
                control.plans.change_plan(page._state.plan.value.model_copy(update={"spectral": spectral}))
                self._live_for(DRAG_S)
            self._wait(lambda: len(known.value) > 5)
        cancel = self.stage.window.parts.runner.cancel_all
        self._cancel("predict", cancel, lambda: not self.stage.window.parts.runner.active)
        page.middle.setCurrentWidget(page.effects)
        with self._job("weigh effects"):
            for i in range(DRAGS):
                page.effects.content.choice.setCurrentIndex(i % page.effects.content.choice.count())
                self._live_for(DRAG_S)
            self.stage.idle()
        page.middle.setCurrentWidget(page.view)

    def _reconstruct(self, session: Path) -> None:
        page = self.stage.window.open_page("results")
        assert isinstance(page, ResultsPage)
        control, state = page._control, page._state
        state.result.set(None)
        self.stage.window.open_path(session)
        self._wait(lambda: state.offer.value is not None)
        control.reconstruct()
        with self._job("reconstruct, its beginning"):
            self._wait(lambda: any(job.progress.done > 0 for job in self.stage.window.parts.runner.active))
        cancel = self.stage.window.parts.runner.cancel_all
        self._cancel("reconstruct", cancel, lambda: not state.busy.value)
        with self._job("reconstruct"):
            control.reconstruct()
            self._wait(lambda: state.result.value is not None)
            self.stage.idle()

    # Calibrate -------------------------------------------------------------------------------------

    def _calibrate(self, name: str) -> None:
        campaign = self.stage.copied(self.stage.material.complete)
        info = CampaignFolder.open(campaign).info
        rig = self.stage.composition.rig
        choice = RigChoice(info.rig, tuple(info.options.items()))
        if rig.state.choice.value != choice or rig.state.link.value is not Link.OPEN:
            self.stage.connect(choice)
        page = self.stage.window.open_page("calibrate")
        self.stage.idle()
        with self._job(f"{name}: open wizard"):
            page._commands.run(name)  # type: ignore[attr-defined]
            wizard = self.stage.dialog(CalibrationWizard)
            state, control = wizard._state, wizard._commands
            self._wait(lambda: state.doing.value is Doing.IDLE)
        with self._job(f"{name}: look"):
            control.go_to(1)
            control.check(True)
            self._wait(lambda: state.look.value is not None)
            control.check(False)
            self._wait(lambda: state.doing.value is Doing.IDLE)
        control.capture()
        self._wait(lambda: state.doing.value is Doing.CAPTURING)
        self._live_for(CAPTURE_S)
        if state.doing.value is Doing.CAPTURING:
            self._cancel(f"{name}: capture", control.stop, lambda: state.doing.value is Doing.IDLE)
        with self._job(f"{name}: capture"):
            control.go_to(1)
            control.capture()
            self._wait(lambda: state.doing.value is Doing.CAPTURING)
            self._wait(lambda: state.doing.value is Doing.IDLE)
        assert not state.trouble.value, state.trouble.value
        with self._job(f"{name}: fit"):
            control.fit()
            self._wait(lambda: state.fit.value is not None or bool(state.trouble.value))
            self._wait(lambda: state.doing.value is Doing.IDLE)
        assert not state.trouble.value, state.trouble.value
        control.fit()
        self._live_for(0.5)
        if state.doing.value is Doing.FITTING:
            self._cancel(f"{name}: fit", control.stop, lambda: state.doing.value is Doing.IDLE)
        wizard.reject()
        self.stage.idle()

    # Results ---------------------------------------------------------------------------------------

    def _results(self) -> None:
        page = self.stage.window.open_page("results")
        assert isinstance(page, ResultsPage)
        state = page._state
        state.result.set(None)
        with self._job("open full-size result"):
            self.stage.window.open_path(self._full)
            self._wait(lambda: state.result.value is not None)
            self.stage.idle()
        for view in ("band", "depth", "quality", "colour"):
            with self._job(f"view {view}"):
                self.stage.window.do(f"view_{view}")
                self.stage.idle()
        with self._job("3D cloud, 500,000 points"):
            self.stage.window.do("view_cloud")
            self.stage.idle()
            self._wait(lambda: page.cloud.view is not None)
            self._live_for(GROW_S)
        with self._job("relight"):
            page._control.relight("A", False)
            self.stage.idle()
            self._live_for(GROW_S)
        with self._job("look for a spectrum"):
            page._control.point_at((400, 300))
            page._control.search.start(page.search.content.mode.itemData(0))
            self.stage.idle()
            self._live_for(GROW_S)
        page._control.search.clear()
        self.stage.window.do("view_colour")

    def _export(self) -> None:
        page = self.stage.window.open_page("results")
        assert isinstance(page, ResultsPage)
        with self._job("export"):
            exports(page._control).write(
                {form: self.stage.folder / f"out.{ENDINGS[form]}" for form in ENDINGS}, True
            )
            self.stage.idle()
        runner = self.stage.window.parts.runner
        for form, ending in ENDINGS.items():
            exports(page._control).write({form: self.stage.folder / f"out.{ending}"}, True)
            self._live_for(EXPORT_S)
            if runner.active:
                self._cancel(f"export {form}", runner.cancel_all, lambda: not runner.active)

    def _compare(self) -> None:
        page = self.stage.window.open_page("compare")
        assert isinstance(page, ComparePage)
        with self._job("compare"):
            for name, second in (("chart.zarr", False), ("chart-again.zarr", True)):
                page._control.open_side(self.stage.material.scans / name, second=second)
                self.stage.idle()
            self._wait(lambda: page.pair._state.pair.value is not None)
        with self._job("compare with truth"):
            page._control.use_truth()
            self.stage.idle()


def _latest(target: Path) -> Path:
    return max(target.parent.glob("*.dsl"), key=lambda path: path.stat().st_mtime)
