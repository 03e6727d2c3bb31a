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
#: Two pictures of one shot have the same mean vote, but for this much, unless one of them was wrong.
SAME_TWICE = 0.1


class UsualVotes:
    """Remembers the mean votes of pictures, by rival and setting."""

    def __init__(self) -> None:
        """Start without any picture."""
        self._known: dict[tuple[Verdict, int], deque[float]] = {}
        self._unclear: dict[tuple[Verdict, int], float] = {}

    def copy(self) -> UsualVotes:
        """What is remembered now."""
        twin = UsualVotes()
        twin._known = {key: known.copy() for key, known in self._known.items()}
        twin._unclear = self._unclear.copy()
        return twin

    def is_unclear(self, shot: Shot, rival: Verdict, contest: Contest) -> bool:
        """Whether a picture is less its own pattern than those before were; if not, it is remembered.

        So is one that stays as it is when it is taken again: finer or brighter surfaces are less clear.
        """
        if not contest.is_told:
            return False
        known = self._known.setdefault((rival, shot.setting), deque(maxlen=REMEMBERED))
        lack = max(LEAST_LACK, OF_FEW / contest.count**0.5)
        is_unclear = len(known) >= FEWEST and contest.mean < (1 - lack) * median(known)
        before = self._unclear.pop((rival, shot.index), None)
        if not is_unclear or (before is not None and abs(contest.mean - before) < SAME_TWICE):
            known.append(contest.mean)
        else:
            self._unclear[rival, shot.index] = contest.mean
        return is_unclear
