"""After a motion: whether everything is back in its place, and what has to be captured again if it is.

What old pictures, taken again, showed at the time does not change any more. So white, black and a frame of
the code are captured once more; where they look as they did when the scan began, everything since the old
pictures last did is withdrawn, and the scan takes it again.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.motion import Movement
from dsl_core.capture.sentinels import SentinelWatch
from dsl_core.model.frames import FrameSink
from dsl_core.model.plan import CapturePlan, Shot

#: What a person can do about a motion while the capture can still be completed.
ADVICE = "Put back what moved, or start from the beginning if that is impossible."


class PutBack:
    """Withdraws what was captured while something was out of its place, once that is back."""

    def __init__(
        self,
        plan: CapturePlan,
        watch: SentinelWatch | None,
        take: Callable[[Shot], NDArray[np.uint16]],
        sink: FrameSink,
    ) -> None:
        """Without a ``watch`` nothing ever moved. ``take`` captures a shot that is not saved: raw, DN."""
        self._plan, self._watch, self._take, self._sink = plan, watch, take, sink

    @property
    def moved(self) -> Movement | None:
        """What moved, by the old pictures of this run and of earlier ones."""
        return None if self._watch is None else self._watch.found

    def still_away(self) -> Movement | None:
        """How far what moved is from its place now; None once it is back, or if nothing moved.

        Then all since it was last there is withdrawn. Raises what ``take`` raises, and `StoreError`.
        """
        if self._watch is None or self._watch.found is None:
            return None
        away = self._watch.moved_now(self._take)
        if away is None:
            after = self._watch.found.after
            since = [shot for shot in self._plan.shots() if after is None or shot.index > after]
            self._sink.withdraw(since)
            self._watch.forget(since)
        return away
