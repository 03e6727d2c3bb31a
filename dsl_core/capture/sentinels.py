"""Whether camera or scene moved during a scan: sentinels, compared with the pictures that they repeat.

White says where the picture is, a frame of the code where the pattern is on it: an object that comes nearer
hardly moves in the picture, but the stripes on it do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.motion import Movement, moved_between
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Sensor


class SentinelWatch:
    """Takes the frames of a scan in their order, and says when something has moved."""

    def __init__(self, plan: CapturePlan, sensor: Sensor | None = None) -> None:
        """Without a ``sensor``, a usual one is assumed."""
        self._sensor = sensor or Sensor()
        self._old = {s.index: plan.original(s) for s in plan.shots() if s.role == "sentinel"}
        self._references = plan.references()
        self._kept: dict[int, NDArray[np.uint16]] = {}
        self._black: dict[int, int] = {}
        self._still: dict[str, int] = {}
        self.found: Movement | None = None

    @property
    def wanted(self) -> frozenset[int]:
        """Indices of the shots that are looked at."""
        references = {shot.index for shot in self._references.values()}
        return frozenset(self._old) | {shot.index for shot in self._old.values()} | references

    def learn(self, stored: FrameSource, there: Iterable[Shot]) -> None:
        """Look at frames of earlier runs."""
        for shot in there:
            if shot.index in self.wanted:
                self.add(shot, stored.read(shot))

    def add(self, shot: Shot, pixels: NDArray[np.uint16]) -> None:
        """Look at a frame (rows, columns), DN; ``found`` says what moved, first of all."""
        if self.found is not None or shot.index not in self.wanted:
            return
        self._kept[shot.index] = pixels
        old = self._old.get(shot.index)
        if old is None:
            return
        if old.role == "black":
            # Both pictures of a round lose the black next to them: light of the room may change.
            self._judge(shot.index - 1, shot.index, old.index)
            self._black = {shot.index: old.index}
        elif old.role == "code":
            for black, old_black in self._black.items():
                self._judge(shot.index, black, old_black)

    def moved_now(self, take: Callable[[Shot], NDArray[np.uint16]]) -> Movement | None:
        """How white and a frame of the code, captured by ``take``, differ from those of the scan's beginning.

        What is no longer there of these says nothing. Raises what ``take`` raises.
        """
        there = {role: shot for role, shot in self._references.items() if shot.index in self._kept}
        if "black" not in there:
            return None
        old = {role: self._kept[shot.index] for role, shot in there.items()}
        new = {role: take(shot) for role, shot in there.items()}
        for role in sorted(there.keys() - {"black"}, reverse=True):
            pairs = (old[role], old["black"]), (new[role], new["black"])
            if found := moved_between(*pairs, self._sensor, role == "code"):
                return found
        return None

    def forget(self, shots: Iterable[Shot]) -> None:
        """Forget frames that were withdrawn, and the motion that they showed."""
        gone = {shot.index for shot in shots}
        self._kept = {index: pixels for index, pixels in self._kept.items() if index not in gone}
        self._still = {role: index for role, index in self._still.items() if index not in gone}
        self._black = {}
        self.found = None

    def _judge(self, index: int, black: int, old_black: int) -> None:
        old = self._old.get(index)
        if old is None or not {black, old_black, index, old.index} <= self._kept.keys():
            return
        kept = self._kept
        self.found = moved_between(
            (kept[old.index], kept[old_black]), (kept[index], kept[black]), self._sensor, old.role == "code"
        )
        if self.found is None:
            self._still[old.role] = index
        else:
            since = self._still.get(old.role, old.index)
            self.found = replace(self.found, after=since, before=index)


def movement_of(
    source: FrameSource, sensor: Sensor | None = None, missing: Iterable[int] = ()
) -> Movement | None:
    """What moved during a scan with all frames but those ``missing``; reads its sentinels."""
    watch, gone = SentinelWatch(source.plan, sensor), set(missing)
    watch.learn(source, (shot for shot in source.plan.shots() if shot.index not in gone))
    return watch.found
