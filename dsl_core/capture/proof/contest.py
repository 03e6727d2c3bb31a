"""Two predictions of a picture, and which of them it is: every pixel that tells them apart has a vote."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

#: Votes needed to tell anything.
FEWEST = 12
#: Mean vote below which a picture is not the one wanted: 1 if it is, -1 if it is the rival.
LEAST_MEAN = 0.15
#: Votes against, net of those for, at the upper or lower end of a picture that make it torn: at least so
#: many, and at least this share of all.
TORN_VOTES, TORN_SHARE = 8.0, 0.02
#: The same of rows anywhere, from which on another picture is asked for: right ones hardly ever have one net
#: vote against in a row.
DOUBTFUL_VOTES, DOUBTFUL_SHARE = 1.5, 0.005


@dataclass(frozen=True)
class Contest:
    """The result of `vote`: ``count`` voters and their ``mean``.

    ``worst_end`` is the lowest sum of votes from either end on, ``worst_run`` that of neighbours anywhere.
    """

    count: int = 0
    mean: float = 1.0
    worst_end: float = 0.0
    worst_run: float = 0.0

    @property
    def is_told(self) -> bool:
        """Whether there were votes enough."""
        return self.count >= FEWEST

    @property
    def is_lost(self) -> bool:
        """Whether the picture as a whole is not the one wanted."""
        return self.is_told and self.mean < LEAST_MEAN

    @property
    def is_torn(self) -> bool:
        """Whether the picture is the one wanted only above or below some row."""
        return self.is_told and self.worst_end < -max(TORN_VOTES, TORN_SHARE * self.count)

    @property
    def is_doubtful(self) -> bool:
        """Whether a few pixels of rows next to each other are unlike the picture wanted."""
        return self.is_told and self.worst_run < -max(DOUBTFUL_VOTES, DOUBTFUL_SHARE * self.count)


def vote(seen: Floats, wanted: Floats, rival: Floats) -> Contest:
    """The contest of two predictions; the arguments are those of `ballots`."""
    return counted(ballots(seen, wanted, rival))


def ballots(seen: Floats, wanted: Floats, rival: Floats) -> Floats:
    """Votes of pixels, each between -1 and 1; flat arrays, row after row, of pixels that tell them apart.

    A pixel half way between both predictions has no opinion; one at or beyond a prediction votes for it.
    """
    votes = 2 * seen - wanted
    votes -= rival
    votes /= wanted - rival
    return np.asarray(np.minimum(np.maximum(votes, -1, out=votes), 1, out=votes))


def counted(votes: Floats) -> Contest:
    """What votes of pixels, row after row, say together."""
    if votes.size == 0:
        return Contest()
    sums = np.cumsum(votes, dtype=np.float64)
    total = float(sums[-1])
    # What is left after the best beginning is the worst end.
    peaks = np.maximum(np.maximum.accumulate(sums), 0)
    run = min(float((sums - peaks).min()), 0.0)
    end = min(float(sums.min()), total - float(sums.max()), 0.0)
    return Contest(votes.size, total / votes.size, end, run)
