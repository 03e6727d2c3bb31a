"""The time left of a whole job, smoothed: from the pace of its stage and what the next ones took before."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

#: The time shown follows a changed estimate within about this time, s.
SETTLE_S = 4.0
#: A stage of a short job says little about the pace of others: shares of its last time that count.
LEAST_RATIO, MOST_RATIO = 0.2, 20.0

#: What the stages of a kind of job took when one ended last, in their order, s.
Course = dict[str, float]


@dataclass(frozen=True)
class TimeLeft:
    """Seconds left; ``is_whole`` says whether they are those of the whole job or of its stage alone."""

    seconds: float
    is_whole: bool


class JobClock:
    """Follows one job. ``courses`` are those of earlier jobs by kind; a job that is done adds its own."""

    def __init__(
        self, kind: str, courses: dict[str, Course], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._kind, self._courses, self._clock = kind, courses, clock
        self._took: Course = {}
        self._stage, self._done, self._total = "", 0, 0
        self._since_s = self._shown_at_s = clock()
        self._shown: TimeLeft | None = None

    def report(self, stage: str, done: int, total: int) -> None:
        """Take a report of the job."""
        if stage != self._stage:
            self._close_stage()
            self._stage, self._since_s = stage, self._clock()
            if self._shown is not None and not self._shown.is_whole:
                # What was left of one stage says nothing about the next.
                self._shown = None
        self._done, self._total = done, total

    def end(self) -> None:
        """Remember how long the stages of a job took that is done."""
        self._close_stage()
        if self._took:
            self._courses[self._kind] = dict(self._took)

    def _close_stage(self) -> None:
        if self._stage:
            spent = self._clock() - self._since_s
            self._took[self._stage] = self._took.get(self._stage, 0.0) + spent

    def left(self) -> TimeLeft | None:
        """The time left now, None while unknown; it falls evenly and follows estimates slowly."""
        estimate = self._estimate()
        now = self._clock()
        passed, self._shown_at_s = now - self._shown_at_s, now
        if estimate is None:
            self._shown = None
        elif self._shown is None or self._shown.is_whole != estimate.is_whole:
            self._shown = estimate
        else:
            expected = self._shown.seconds - passed
            step = (estimate.seconds - expected) * (1 - math.exp(-passed / SETTLE_S))
            self._shown = TimeLeft(max(expected + step, 0.0), estimate.is_whole)
        return self._shown

    def _estimate(self) -> TimeLeft | None:
        course, spent = self._courses.get(self._kind, {}), self._clock() - self._since_s
        is_known = self._stage in course
        if self._total > 0 and self._done > 0:
            here = spent * (self._total - self._done) / self._done
        elif is_known:
            here = max(course[self._stage] - spent, 0.0)
        else:
            return None
        if not is_known:
            return TimeLeft(here, False)
        names = list(course)
        later = sum(course[name] for name in names[names.index(self._stage) + 1 :])
        return TimeLeft(here + later * self._ratio(course, spent + here), True)

    def _ratio(self, course: Course, stage_s: float) -> float:
        """How much longer this job takes than the last one, by the stages that both have had."""
        took = {**self._took, self._stage: self._took.get(self._stage, 0.0) + stage_s}
        before = sum(course[name] for name in took if name in course)
        now = sum(seconds for name, seconds in took.items() if name in course)
        return min(max(now / before, LEAST_RATIO), MOST_RATIO) if before > 0 else 1.0
