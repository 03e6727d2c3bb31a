"""How long the reconstruction of a scan will take, by its plan and what the last one took here. No Qt."""

from __future__ import annotations

from collections.abc import Callable

from dsl_app.shared.notify import describe_seconds
from dsl_core.model.plan import CapturePlan
from dsl_core.planning.computing_time import computing_seconds

#: Paces beyond these are those of a computer that did something else, or slept.
LEAST, MOST = 0.05, 20.0


class Pace:
    """Times as long as expected that this computer takes; ``keep`` is told each, for later sessions."""

    def __init__(self, pace: float = 1.0, keep: Callable[[float], object] = lambda _: None) -> None:
        self._pace, self._keep = pace, keep

    def expected_s(self, plan: CapturePlan) -> float:
        """Seconds that the reconstruction of a plan's scan takes."""
        return self._pace * computing_seconds(plan)

    def learn(self, plan: CapturePlan, seconds: float) -> None:
        """Take what a reconstruction took."""
        pace = seconds / computing_seconds(plan)
        if LEAST <= pace <= MOST:
            self._pace = pace
            self._keep(pace)


def about(seconds: float) -> str:
    """A time that is only roughly known, in words.

    >>> about(4.0), about(44.0), about(155.0)
    ('a few seconds', 'about 40 s', 'about 3 min')
    """
    return "a few seconds" if seconds < 8 else f"about {describe_seconds(max(round(seconds, -1), 10))}"
