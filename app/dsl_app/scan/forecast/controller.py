"""Accuracy against time on the current rig: predicted, requested, and measured after a scan. No Qt."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.connection.state import RigState
from dsl_app.scan.forecast.job import ForecastBasis, ForecastJob, usual_candidates
from dsl_app.scan.forecast.state import ForecastPoint, ForecastState, MeasuredScan, identity
from dsl_app.scan.plan import KEEPS_ITS_PLAN, ScanPlanController
from dsl_app.scan.state import Phase, ScanState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier, sentence_of
from dsl_core.errors import DslError, PlanError
from dsl_core.model.plan import CapturePlan
from dsl_core.progress import Progress

if TYPE_CHECKING:
    from dsl_core.evaluation.summary import Evaluation

NO_CALIBRATION = (
    "Predictions for this rig need a calibration. Calibrate the rig, or choose a calibration from the"
    " library on the right."
)


class ForecastController:
    """Predicts presets, candidates and the current plan in one job that can be stopped and restarted.

    ``folder`` caches predictions. Unless ``automatic``, only `begin` starts the job; if so, it starts while
    the page is open. What is not cached is predicted for presets and the current plan, and for all candidates
    on request.
    """

    def __init__(
        self,
        state: ForecastState,
        scan: ScanState,
        rig: RigState,
        plans: ScanPlanController,
        runner: JobRunner,
        notifier: Notifier,
        folder: Path,
        automatic: bool = False,
        candidates: Callable[[ForecastBasis], Iterable[CapturePlan]] = usual_candidates,
    ) -> None:
        self.state, self._scan, self._rig, self._plans = state, scan, rig, plans
        self._runner, self._notifier, self._folder = runner, notifier, folder
        self._may_start, self._candidates = automatic, candidates
        self._is_open = self._wants_all = False
        self._known: dict[int, ForecastPoint] = {}
        self._refused: dict[int, str] = {}
        self._work: ForecastJob | None = None
        self._job: Job[None] | None = None
        self._of: ForecastBasis | None = None
        #: Whether only custom plans are left to predict: all others are done, or the person stopped the job.
        self._is_complete = False
        self._stops = [
            rig.usable.follow(lambda _: self._renew()),
            scan.calibration.changed.connect(lambda _: self._renew()),
            scan.plan.changed.connect(lambda _: self._plan_changed()),
            scan.phase.changed.connect(self._phase_changed),
            scan.result.connect(self._measure),
        ]

    @property
    def _automatic(self) -> bool:
        return self._may_start and self._is_open

    def open(self, is_open: bool) -> None:
        """Whether the page that shows predictions is open."""
        self._is_open = is_open
        if self._automatic:
            self.begin()

    # Predict ---------------------------------------------------------------------------------------

    def _rigging(self) -> ForecastBasis | None:
        known = self._plans.calibration
        if known is None:
            return None
        scan, camera = self._scan, self._rig.camera
        basis = ForecastBasis(known, scan.latency_ms.value, scan.period_ms.value, self.state.look.value)
        return basis if camera is None else replace(basis, exposure_range_ms=camera.exposure_range_ms)

    def look(self, result: Path | None) -> None:
        """Predict for the scene of a result, or for a Color Checker."""
        self.state.look.set(result)
        self._renew()

    def _renew(self) -> None:
        """Discard predictions for another rig or calibration."""
        now, is_there = self._rigging(), self._rig.usable.value is not None
        self.state.trouble.set(NO_CALIBRATION if now is None and is_there else "")
        self.state.is_ready.set(self._may_start and now is not None and is_there)
        if now == self._of:
            return
        self._stop()
        self._of, self._known, self._refused, self._is_complete = now, {}, {}, False
        self._wants_all = False
        if now is not None:
            self.state.depth_mm.set(now.rig.usual_depth_mm)
        self.state.points.set(())
        self.state.left.set(0)
        self._show_current()
        self.state.answer.set("")
        if self._automatic:
            self.begin()

    def begin(self) -> None:
        """Predict what is not known yet, unless a scan is running."""
        if self._of is None or self._job is not None or self._scan.phase.value.is_busy:
            return
        plan = self._scan.plan.value
        if self._is_complete and (identity(plan) in self._known or identity(plan) in self._refused):
            return
        candidates = None if self._is_complete else self._candidates
        self._work = work = ForecastJob(self._of, self._folder, candidates, self._must_wait, self._wants_all)
        work.want(plan)
        self._job = job = Job(
            "Predict accuracy against time",
            work.work,
            lambda _: self._ended(work, complete=True),
            lambda error: self._failed(work, error),
            lambda: self._ended(work, complete=False),
            is_minor=True,
        )
        # The total is not known yet, but show that something is running.
        self.state.progress.set((0, 1))
        self._runner.submit(job)

    def predict_all(self) -> None:
        """Predict all candidates as well."""
        self._wants_all, self._is_complete = True, False
        self.begin()

    def _must_wait(self) -> bool:
        return any(not job.is_minor for job in self._runner.active)

    def _stop(self) -> None:
        if self._job is not None:
            self._job.cancel()
        self._job = self._work = None
        self.state.progress.set((0, 0))

    def _ended(self, work: ForecastJob, complete: bool) -> None:
        if work is not self._work:
            return  # its predictions are for another rig
        self.take_news()
        self._is_complete = True
        if complete and work.asked_for_candidates:
            self.state.left.set(work.left)
        self._stop()
        if complete and self._automatic:
            # The plan may have changed just before the job ended.
            self.begin()

    def _failed(self, work: ForecastJob, error: Exception) -> None:
        if work is self._work:
            self._stop()
            self._is_complete = True
            self.state.trouble.set(f"Prediction failed: {sentence_of(error)}")

    def take_news(self) -> None:
        """Show new predictions; called by a timer."""
        if self._work is None or self._job is None:
            return
        news = self._work.take_news()
        for each in news:
            if isinstance(each, ForecastPoint):
                self._known[each.key] = each
            else:
                self._refused[identity(each.plan)] = each.reason
        if news:
            self.state.points.set(tuple(self._known.values()))
            self._show_current()
        self.state.progress.set((self._job.progress.done, max(self._job.progress.total, 1)))

    def _plan_changed(self) -> None:
        self.state.answer.set("")
        self._show_current()
        if self.state.current.value is not None or self.state.refusal.value:
            return
        if self._work is not None:
            self._work.want(self._scan.plan.value)
        elif self._automatic:
            self.begin()

    def _show_current(self) -> None:
        this = identity(self._scan.plan.value)
        self.state.current.set(self._known.get(this))
        self.state.refusal.set(self._refused.get(this, ""))

    # Choose ----------------------------------------------------------------------------------------

    def choose(self, wanted: ForecastPoint) -> None:
        """Use this plan."""
        self._plans.change_plan(wanted.plan)

    def answer(self, budget_s: float | None = None, error: float | None = None) -> None:
        """Use the most accurate plan within a time, or the quickest one within an error of single pixels."""
        from dsl_core.planning.choice import Weighed, choose

        points = self.state.points.value
        if not points:
            self.state.answer.set("No plan has been predicted yet. Wait a moment, then try again.")
            return
        done, total = self.state.progress.value
        so_far = f" {done} of {total} plans predicted so far." if done < total else ""
        try:
            found = choose([Weighed(each.plan, each.expected) for each in points], budget_s, error)
        except PlanError as none:
            self.state.answer.set(f"{none}{so_far}")
            return
        best = self._known[identity(found.plan)]
        self.choose(best)
        words = (
            f"{best.title}, {best.expected.seconds:.0f} s, error of a pixel {best.expected.pixel_rmse:.4f}."
        )
        if identity(self._scan.plan.value) == best.key:
            self.state.answer.set(f"Chosen: {words}{so_far}")
        else:
            self.state.answer.set(f"The best plan would be {words}{so_far} {KEEPS_ITS_PLAN}")

    # After a scan ----------------------------------------------------------------------------------

    def _phase_changed(self, phase: Phase) -> None:
        if phase.is_busy:
            self._stop()
        elif self._automatic:
            self.begin()
        if phase is Phase.DONE:
            self._note_scan()

    def _note_scan(self) -> None:
        status, plan = self._scan.status.value, self._scan.plan.value
        # A run does not know how long those before it took.
        seconds = None if self._is_faster_than_real or status.earlier else status.elapsed_s
        name = self._scan.target.value.stem
        self.state.measured.set(MeasuredScan(name, plan, status.total, seconds))

    @property
    def _is_faster_than_real(self) -> bool:
        """Whether the rig is simulated and captures faster than real time."""
        from dsl_core.simulation.sim_devices import SimCamera

        devices = self._rig.devices.value
        is_simulated = devices is not None and isinstance(devices.camera, SimCamera)
        return is_simulated and dict(self._rig.choice.value.options).get("realtime") != "on"

    def _measure(self, result: Path) -> None:
        """Compare a new result with the truth, if known; its scene can then be planned for."""
        self.state.last_look.set(result)
        if self.state.look.value is not None:
            self.look(result)
        scan = self.state.measured.value
        if scan is None or scan.name != result.stem:
            return

        def work(progress: Progress) -> MeasuredScan:
            progress.report("compare", 0, 0)
            return measure(scan, result)

        def failed(error: Exception) -> None:
            self._notifier.tell(
                "warning", f"{result.name} could not be compared with the truth: {sentence_of(error)}"
            )

        self._runner.submit(
            Job(f"Compare {result.stem} with the truth", work, self.state.measured.set, failed, is_minor=True)
        )

    def close(self) -> None:
        """Disconnect from all state and stop the job."""
        for stop in self._stops:
            stop()
        self._stop()


def measure(scan: MeasuredScan, result: Path) -> MeasuredScan:
    """The scan with what its reconstruction took, and with its errors where the truth is known."""
    from dsl_core.evaluation.cost import costs_of
    from dsl_core.evaluation.summary import evaluate
    from dsl_core.io.result.result_file import load_result
    from dsl_core.workflows.truths import truth_of

    found = load_result(result)
    scan = replace(scan, computing_s=sum(stage.seconds for stage in costs_of(found.attrs)) or None)
    try:
        truth = truth_of(found)
    except DslError:  # a real rig, whose scene is unknown
        return scan
    return _with_errors(scan, evaluate(found, truth))


def _with_errors(scan: MeasuredScan, found: Evaluation) -> MeasuredScan:
    if found.depth is not None:
        scan = replace(scan, depth_rmse_mm=found.depth.rmse_mm, coverage=found.depth.coverage)
    if not found.patches:
        return scan
    delta_e = found.mean("delta_e")
    return replace(
        scan,
        rmse=found.mean("rmse"),
        pixel_rmse=found.pixel_rmse,
        pixel_angle_rad=found.mean("pixel_angle_rad"),
        delta_e=None if math.isnan(delta_e) else delta_e,
        fwhm_nm=found.mean_fwhm_nm,
    )
