"""Whether camera or scene moved during a scan: sentinels, compared with the pictures that they repeat.

White says where the picture is, a frame of the code where the pattern is on it: an object that comes nearer
hardly moves in the picture, but the stripes on it do.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.motion import Movement, moved_between
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Sensor
from dsl_core.optics.seen_noise import PAIRS, seen_sensor, usual_sensor
from dsl_core.patterns.inverse_pairs import inverse_pairs
from dsl_core.solve.thinned import spread_rows

#: Rows of a frame that its noise is told by.
ROWS = 64


class SensorWatch:
    """Takes the frames of a scan, and says what their counts are worth, of a calibrated camera or another."""

    def __init__(self, plan: CapturePlan, sensor: Sensor | None, bit_depth: int, bayer: str = "RGGB") -> None:
        """A known ``sensor`` counts as it is; without one, frames have this ``bit_depth`` and ``bayer``."""
        self._known = sensor
        self._stated = usual_sensor(bit_depth).model_copy(update={"bayer": bayer})
        sets = [] if sensor or not plan.code_count else inverse_pairs(plan.code, plan.projector_size_px)
        self._pairs = sets[0][:PAIRS] if sets else ()
        patterns = {number for pair in self._pairs for number in pair}
        self._pattern_of = {
            shot.index: shot.pattern
            for shot in (plan.shots() if patterns else ())
            if (shot.role, shot.setting) == ("code", min(plan.code_settings)) and shot.pattern in patterns
        }
        self._seen: dict[int, NDArray[np.uint16]] = {}

    @property
    def wanted(self) -> frozenset[int]:
        """Indices of the shots that are looked at."""
        return frozenset(self._pattern_of)

    def add(self, shot: Shot, pixels: NDArray[np.uint16]) -> None:
        """Look at a frame (rows, columns), DN."""
        if shot.index in self._pattern_of:
            self._seen[shot.pattern] = pixels[spread_rows(pixels.shape[0], ROWS)]

    def forget(self, gone: Collection[int]) -> None:
        """Forget frames that were withdrawn."""
        for index in gone:
            self._seen.pop(self._pattern_of.get(index, -1), None)

    def given(self, black: NDArray[np.uint16]) -> Sensor:
        """The sensor of a scan with this black picture."""
        if self._known is not None:
            return self._known
        pairs = [(self._seen[a], self._seen[b]) for a, b in self._pairs if {a, b} <= self._seen.keys()]
        return seen_sensor(self._stated, black, pairs)


class SentinelWatch:
    """Takes the frames of a scan in their order, and says when something has moved."""

    def __init__(self, plan: CapturePlan, sensor: Sensor | None = None, bit_depth: int = 12) -> None:
        """Without a ``sensor``, that which frames of ``bit_depth`` show is assumed."""
        self._sensor = SensorWatch(plan, sensor, bit_depth)
        self._old = {s.index: plan.original(s) for s in plan.shots() if s.role == "sentinel"}
        self._references = plan.references()
        others = (*self._old.values(), *self._references.values())
        self._compared = frozenset(self._old) | {shot.index for shot in others}
        self._kept: dict[int, NDArray[np.uint16]] = {}
        self._black: dict[int, int] = {}
        self._still: dict[str, int] = {}
        self.found: Movement | None = None

    @property
    def wanted(self) -> frozenset[int]:
        """Indices of the shots that are looked at."""
        return self._compared | self._sensor.wanted

    def learn(self, stored: FrameSource, there: Iterable[Shot]) -> None:
        """Look at frames of earlier runs."""
        for shot in there:
            if shot.index in self.wanted:
                self.add(shot, stored.read(shot))

    def add(self, shot: Shot, pixels: NDArray[np.uint16]) -> None:
        """Look at a frame (rows, columns), DN; ``found`` says what moved, first of all."""
        if self.found is not None or shot.index not in self.wanted:
            return
        self._sensor.add(shot, pixels)
        if shot.index not in self._compared:
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
        sensor = self._sensor.given(old["black"])
        for role in sorted(there.keys() - {"black"}, reverse=True):
            pairs = (old[role], old["black"]), (new[role], new["black"])
            if found := moved_between(*pairs, sensor, role == "code"):
                return found
        return None

    def forget(self, shots: Iterable[Shot]) -> None:
        """Forget frames that were withdrawn, and the motion that they showed."""
        gone = {shot.index for shot in shots}
        self._kept = {index: pixels for index, pixels in self._kept.items() if index not in gone}
        self._still = {role: index for role, index in self._still.items() if index not in gone}
        self._sensor.forget(gone)
        self._black = {}
        self.found = None

    def _judge(self, index: int, black: int, old_black: int) -> None:
        old = self._old.get(index)
        if old is None or not {black, old_black, index, old.index} <= self._kept.keys():
            return
        kept = self._kept
        before, now = (kept[old.index], kept[old_black]), (kept[index], kept[black])
        self.found = moved_between(before, now, self._sensor.given(before[1]), old.role == "code")
        if self.found is None:
            self._still[old.role] = index
        else:
            since = self._still.get(old.role, old.index)
            self.found = replace(self.found, after=since, before=index)


def movement_of(
    source: FrameSource, sensor: Sensor | None = None, missing: Iterable[int] = (), bit_depth: int = 12
) -> Movement | None:
    """What moved during a scan with all frames but those ``missing``; reads its sentinels.

    Without a ``sensor``, that which frames of ``bit_depth`` show is assumed.
    """
    watch, gone = SentinelWatch(source.plan, sensor, bit_depth), set(missing)
    watch.learn(source, (shot for shot in source.plan.shots() if shot.index not in gone))
    return watch.found
