"""Predicts plans in a job's thread, the requested one first. No Qt."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.scan.forecast.state import ForecastPoint, identity
from dsl_core.errors import DslError
from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import PRESETS, on_columns, on_cycles
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress
from dsl_core.words import sentence

if TYPE_CHECKING:
    from dsl_core.planning.expected import Prediction
    from dsl_core.planning.samples import SamplePixels
    from dsl_core.planning.store import PredictionStore

#: Interval at which to check whether other work has ended, s.
LOOK_S = 0.1


@dataclass(frozen=True)
class Refused:
    """A plan that cannot be predicted, and why."""

    plan: CapturePlan
    reason: str


@dataclass(frozen=True)
class ForecastBasis:
    """What predictions are based on: a calibration, the projector's latency and frame period, and a scene.

    ``look`` is a result of the scene; None for a Color Checker. Plans beyond what the camera exposes for are
    refused.
    """

    rig: Rig
    latency_ms: float
    period_ms: float
    look: Path | None = None
    exposure_range_ms: tuple[float, float] = (0.0, math.inf)

    @property
    def scene(self) -> str:
        """An identifier of the scene that also distinguishes results of the same name."""
        if self.look is None:
            return ""
        try:
            return f"{self.look} {self.look.stat().st_mtime_ns}"
        except OSError:  # reported when it is read
            return str(self.look)


def usual_candidates(basis: ForecastBasis) -> Iterable[CapturePlan]:
    """All plans that the planner considers."""
    from dsl_core.planning.choice import candidate_plans

    return candidate_plans(basis.rig, basis.exposure_range_ms[1])


class ForecastJob:
    """Predicts presets, then candidates; `work` belongs to the job's thread, everything else to the window's.

    Of the candidates only known ones are shown, unless ``all_plans`` are to be predicted; ``left`` counts the
    others. Without candidates only the requested plan is predicted. ``must_wait`` tells whether other work
    has priority.
    """

    def __init__(
        self,
        rigging: ForecastBasis,
        folder: Path,
        candidates: Callable[[ForecastBasis], Iterable[CapturePlan]] | None,
        must_wait: Callable[[], bool],
        all_plans: bool = False,
    ) -> None:
        self.rigging, self.left, self._all = rigging, 0, all_plans
        self._folder, self._candidates, self._must_wait = folder, candidates, must_wait
        self._lock = threading.Lock()
        self._wanted: CapturePlan | None = None
        self._news: list[ForecastPoint | Refused] = []
        self._view: SamplePixels | None = None

    @property
    def asked_for_candidates(self) -> bool:
        """Whether candidates were looked at."""
        return self._candidates is not None

    # In the window's thread ------------------------------------------------------------------------

    def want(self, plan: CapturePlan) -> None:
        """Predict this plan next."""
        with self._lock:
            self._wanted = plan

    def take_news(self) -> list[ForecastPoint | Refused]:
        """Predictions since the last call."""
        with self._lock:
            news, self._news = self._news, []
        return news

    # In the job's thread ---------------------------------------------------------------------------

    def work(self, progress: Progress) -> None:
        """Predict everything that is not cached; raises `DslError` if nothing can be predicted at all."""
        from dsl_core.planning.store import PredictionStore

        rig = self.rigging.rig
        store = PredictionStore(self._folder, rig, self.rigging.latency_ms, self.rigging.scene)
        presets = {identity(p): key for key, p in self._presets()}
        seen: dict[int, CapturePlan] = {}
        if self._candidates is not None:
            for plan in (*(p for _, p in self._presets()), *self._candidates(self.rigging)):
                key = identity(plan)
                if self._all or key in presets or store.find(plan.sized(rig.camera, rig.projector)):
                    seen.setdefault(key, plan)
                elif key not in seen:
                    self.left += 1
        todo = deque(seen.values())
        try:
            while (turn := self._next(todo)) is not None:
                plan, is_wanted = turn
                progress.report("predict plans", len(seen) - len(todo), len(seen))
                if not is_wanted:
                    self._wait(progress)
                self._post(self._of(plan, store, presets.get(identity(plan), "")))
        finally:
            store.save()

    def _presets(self) -> list[tuple[str, CapturePlan]]:
        width_px = self.rigging.rig.projector.width_px
        return [
            (each.key, on_columns(on_cycles(each.plan, self.rigging.period_ms), width_px)) for each in PRESETS
        ]

    def _next(self, todo: deque[CapturePlan]) -> tuple[CapturePlan, bool] | None:
        """The next plan, and whether it was requested."""
        with self._lock:
            wanted, self._wanted = self._wanted, None
        if wanted is not None:
            return wanted, True
        return (todo.popleft(), False) if todo else None

    def _wait(self, progress: Progress) -> None:
        """Let work that the person started go first."""
        while self._must_wait():
            progress.report("wait for other work", 0, 0)
            time.sleep(LOOK_S)

    def _post(self, news: ForecastPoint | Refused) -> None:
        with self._lock:
            self._news.append(news)

    def _of(self, plan: CapturePlan, store: PredictionStore, preset: str) -> ForecastPoint | Refused:
        from dsl_core.capture.preflight import exposure_obstacles

        rig = self.rigging.rig
        obstacles = list(exposure_obstacles(self.rigging.exposure_range_ms, plan))
        if obstacles:
            return Refused(plan, f"{sentence('; '.join(obstacles))} Choose exposures in this range.")
        sized = plan.sized(rig.camera, rig.projector)
        known = store.find(sized)
        if known is not None:
            return ForecastPoint(plan, known, preset)
        view = self._look()
        try:
            found = self._predict(sized, view)
        except DslError as error:
            return Refused(plan, str(error))
        store.keep(sized, found)
        return ForecastPoint(plan, found, preset)

    def _look(self) -> SamplePixels:
        """Sample pixels of the scene; raises `DslError` if there are none."""
        from dsl_core.planning.samples import plane_samples, scene_samples

        if self._view is not None:
            return self._view
        rig, look = self.rigging.rig, self.rigging.look
        if look is None:
            self._view = plane_samples(rig)
        else:
            from dsl_core.io.result.result_file import load_result

            self._view = scene_samples(rig, load_result(look))
        return self._view

    def _predict(self, plan: CapturePlan, view: SamplePixels) -> Prediction:
        from dsl_core.planning.prediction import predict

        return predict(self.rigging.rig, plan, view, latency_ms=self.rigging.latency_ms)
