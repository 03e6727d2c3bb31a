"""Whether lines are where the code says: that they are shown a column away is not seen otherwise.

A picture that is shown a column to the side looks like the one that was asked for. But pixels of the columns
that it should have lit are dark, and those next to them are lit. A small picture has few such pixels in each
frame, so that frames since some shot are asked together; which shot that is, they say themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.raster import Floats
from dsl_core.model.plan import Shot

#: Columns to either side that lines are compared with.
SIDES = (-1, 1, -2, 2)
#: Votes for the other place, net of those for the right one, and what they are per voter at least: lines
#: in their place have nearly one net vote against it per voter, blurred ones less, but above zero.
FEWEST_VOTES, LEAST_MEAN = 20.0, 0.3
#: Voters, and their mean, that say that a line is not a column away, and so not two.
SURE_VOTES, SURE_MEAN = 12, 0.6
#: Pictures in a row that have to agree: a single one may light little but edges of surfaces.
FEWEST_PICTURES = 2
#: A single one is taken again with `SURE_VOTES` whose mean is as much against its place. Those of lines in
#: their place have always been for it, whatever the scene.
ASIDE = 0.5


def moved(profile: Floats, columns: int) -> Floats:
    """A flat `line_profile` (3 width,) moved by so many columns; what leaves the picture is lost."""
    wide = profile.reshape(-1, 3)
    found = np.zeros_like(wide)
    if columns > 0:
        found[columns:] = wide[:-columns]
    else:
        found[:columns] = wide[-columns:]
    return found.ravel()


def contests_of_sides(contest: Callable[[int], Contest]) -> dict[int, Contest]:
    """The contest of a line's place with each of `SIDES`.

    A line that is two columns away is nearer to one column away than to its place as well: where that is
    surely not so, the farther contest is taken to be like the nearer one, for speed.
    """
    found: dict[int, Contest] = {}
    for side in SIDES:
        near = found.get(side // 2)
        is_sure = near is not None and near.count >= SURE_VOTES and near.mean > SURE_MEAN
        found[side] = near if near is not None and is_sure else contest(side)
    return found


def is_aside(contests: Mapping[int, Contest]) -> bool:
    """Whether a picture by itself seems to be another one, such as itself out of its place, from contests."""
    return any(each.count >= SURE_VOTES and each.mean < -ASIDE for each in contests.values())


class LinePlaces:
    """Remembers what pictures of lines say of their place."""

    def __init__(self) -> None:
        """Start without any picture."""
        self._votes: dict[int, dict[int, tuple[Shot, float, int]]] = {side: {} for side in SIDES}

    def copy(self) -> LinePlaces:
        """What is remembered now."""
        twin = LinePlaces()
        twin._votes = {side: votes.copy() for side, votes in self._votes.items()}
        return twin

    def judge(
        self, shot: Shot, contests: Mapping[int, Contest], is_wrong: bool = False
    ) -> tuple[int, tuple[Shot, ...]] | None:
        """By how many columns lines are away, and the shots since they are up to this one; None if they fit.

        ``contests`` are those of the right place with others. Shots that are returned are forgotten, as they
        have to be taken again. A picture that ``is_wrong`` already needs no others to agree.
        """
        for side, contest in contests.items():
            votes = self._votes[side]
            votes.pop(shot.index, None)
            if contest.count:
                votes[shot.index] = (shot, contest.mean * contest.count, contest.count)
        since = {side: self._since(side, shot, 1 if is_wrong else FEWEST_PICTURES) for side in contests}
        told = {side: self._against(side, shots) for side, shots in since.items() if shots}
        if not told and is_wrong:
            self._forget((shot,))
        if not told:
            return None
        side = max(told, key=lambda each: told[each])
        self._forget(since[side])
        return side, since[side]

    def _against(self, side: int, shots: tuple[Shot, ...]) -> float:
        """Votes of shots that lines are on a side."""
        return -sum(self._votes[side][each.index][1] for each in shots)

    def _forget(self, shots: tuple[Shot, ...]) -> None:
        for votes in self._votes.values():
            for each in shots:
                votes.pop(each.index, None)

    def _since(self, side: int, last: Shot, fewest: int) -> tuple[Shot, ...]:
        """Shots up to the last one that agree best that lines lie on a side; none where they do not."""
        votes, total, count, best = self._votes[side], 0.0, 0, 0.0
        run: list[Shot] = []
        since: tuple[Shot, ...] = ()
        for index in range(last.index, -1, -1):
            if index not in votes:
                continue
            shot, mine, voters = votes[index]
            if shot.setting != last.setting:
                break
            total, count = total + mine, count + voters
            run.append(shot)
            if total > 0:
                break
            if -total <= best:
                continue
            best = -total
            if len(run) >= fewest and best > max(FEWEST_VOTES, LEAST_MEAN * count):
                since = tuple(reversed(run))
        return since
