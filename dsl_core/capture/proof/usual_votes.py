"""How clearly pictures show their own pattern and not another one: a mixture of two does so half-heartedly.

A display that blends pictures, or a camera that averages them, leaves every line where it was, and as bright
as a dim one. Its votes against the line before are fewer than those of the lines before it.
"""

from __future__ import annotations

from collections import deque
from statistics import median

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Verdict
from dsl_core.model.plan import Shot

#: A picture is unclear that lacks this share of the usual mean vote, or so many over the root of the votes,
#: whichever is more: coarse pictures of few pixels lack up to 0.39 with 35 votes, and 0.21 with 150.
LEAST_LACK, OF_FEW = 0.3, 3.0
#: Pictures needed before one can be unlike them, and how many are remembered.
FEWEST, REMEMBERED = 3, 9


class UsualVotes:
    """Remembers the mean votes of pictures, by rival and setting."""

    def __init__(self) -> None:
        """Start without any picture."""
        self._known: dict[tuple[Verdict, int], deque[float]] = {}

    def copy(self) -> UsualVotes:
        """What is remembered now."""
        twin = UsualVotes()
        twin._known = {key: known.copy() for key, known in self._known.items()}
        return twin

    def is_unclear(self, shot: Shot, rival: Verdict, contest: Contest) -> bool:
        """Whether a picture is less its own pattern than those before were; if not, it is remembered."""
        if not contest.is_told:
            return False
        known = self._known.setdefault((rival, shot.setting), deque(maxlen=REMEMBERED))
        lack = max(LEAST_LACK, OF_FEW / contest.count**0.5)
        if len(known) >= FEWEST and contest.mean < (1 - lack) * median(known):
            return True
        known.append(contest.mean)
        return False
