"""Whether the light of a picture has changed all at once: compared with the pictures just before it.

What a film sends to the zero order and what a scene returns change slowly from line to line; a camera that
changes its gain, or a lamp that fails, does not.
"""

from __future__ import annotations

from collections import deque
from statistics import median

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Light
from dsl_core.model.plan import Shot

#: Brightness relative to the pictures before that is no step.
NO_STEP = (0.8, 1.3)
#: The same where it is known from votes alone, which say little of more light and blur less.
NO_STEP_BY_VOTES = (0.9, 1.3)
#: Two pictures of one shot differ by less than this share of their light, unless one of them was wrong.
SAME_TWICE = 0.1
#: Pictures needed before one can be unlike them, and how many are remembered.
FEWEST, REMEMBERED = 3, 9


class LightSteps:
    """Remembers how bright pictures were relative to their prediction, by role and setting."""

    def __init__(self) -> None:
        """Start without any picture."""
        self._known: dict[tuple[str, int, bool], deque[float]] = {}
        self._steps: dict[int, tuple[tuple[str, int, bool], float]] = {}

    def copy(self) -> LightSteps:
        """What is remembered now."""
        twin = LightSteps()
        twin._known = {key: known.copy() for key, known in self._known.items()}
        twin._steps = self._steps.copy()
        return twin

    def judge(self, shot: Shot, share: float | None, dark: Contest | None) -> Light:
        """What a picture says of the light, from its brightness relative to the prediction.

        Where that is not known (None), its contest with black still tells when half of the light is gone, but
        not that nothing has changed.
        """
        if share is not None:
            value = share
        elif dark is not None and dark.is_told:
            value = (dark.mean + 1) / 2  # a pixel votes 1 with all of its light, -1 without any
        else:
            return Light.UNTOLD
        key = (shot.role, shot.setting, share is not None)
        known = self._known.setdefault(key, deque(maxlen=REMEMBERED))
        low, high = NO_STEP_BY_VOTES if share is None else NO_STEP
        is_step = len(known) >= FEWEST and not low < value / max(median(known), 1e-6) < high
        if is_step or self._is_same_step(shot, value):
            self._steps[shot.index] = key, value
            return Light.STEP
        known.append(value)
        return Light.UNTOLD if share is None else Light.USUAL

    def _is_same_step(self, shot: Shot, value: float) -> bool:
        """Whether an earlier picture of the shot was a step, and this one differs by no more than noise."""
        _, before = self._steps.get(shot.index, (None, 0.0))
        return abs(value - before) < SAME_TWICE * before

    def believe(self, shot: Shot) -> None:
        """Take a step for what is usual from now on: a control has shown that the devices are as before."""
        if shot.index in self._steps:
            key, value = self._steps.pop(shot.index)
            self._known[key] = deque([value], maxlen=REMEMBERED)
