"""How much of the light that was predicted pictures show, and whether one shows too little or too much."""

from __future__ import annotations

from collections import deque
from statistics import median

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.model.plan import Shot

#: Brightness relative to that of the shots before that is taken for the same exposure.
SAME_EXPOSURE = (0.68, 1.5)
#: The same for the first shot of a setting, where only the calibration says how bright it should be.
FIRST_EXPOSURE = (0.55, 1.8)
#: How much brighter than expected a line may be: near it is light that its model leaves out.
MOST_LIGHT = 3.0
#: With less light than this, as a share of what is expected, a pattern counts as missing.
LEAST_LIGHT = 0.2
#: Light of a line relative to what it adds to white: a film sends the rest elsewhere.
FILM_SHARE = 0.85
#: Shots whose brightness is remembered.
REMEMBERED = 9


class UsualLight:
    """Remembers, by role and setting, how bright pictures were relative to their prediction."""

    def __init__(self, first_setting: int, is_calibrated: bool) -> None:
        """Without a calibration, the first picture of a role says how bright the others are."""
        self._first_setting, self._is_calibrated = first_setting, is_calibrated
        self._known: dict[tuple[str, int], deque[float]] = {}

    def copy(self) -> UsualLight:
        """What is remembered now."""
        twin = UsualLight(self._first_setting, self._is_calibrated)
        twin._known = {key: known.copy() for key, known in self._known.items()}
        return twin

    def knows(self, shot: Shot) -> bool:
        """Whether there were pictures of the shot's role and setting."""
        return (shot.role, shot.setting) in self._known

    def share(self, shot: Shot) -> float:
        """Light of the pictures before over their prediction, 1 at most; at first, what a film leaves."""
        known = self._known.get((shot.role, shot.setting))
        if known:
            return min(median(known), 1.0)
        return FILM_SHARE if shot.setting == self._first_setting else 1.0

    def judge(self, shot: Shot, share: float | None) -> Finding:
        """Whether a picture is as bright as those before, from its light over its prediction.

        None (it cannot be measured) passes. What is right is remembered.
        """
        if share is None:
            return Finding(shot, Verdict.RIGHT)
        known = self._known.get((shot.role, shot.setting))
        low, high = SAME_EXPOSURE if known else FIRST_EXPOSURE
        if shot.setting == self._first_setting:
            high = MOST_LIGHT
        ratio = share / self.share(shot)
        if not low < ratio < high and (known or self._is_calibrated):
            return Finding(shot, Verdict.EXPOSURE, (shot,), f"{ratio:.2g} times what was expected")
        self._known.setdefault((shot.role, shot.setting), deque(maxlen=REMEMBERED)).append(share)
        return Finding(shot, Verdict.RIGHT)

    def begin(self, shot: Shot) -> None:
        """Take a shot, by which predictions are scaled from now on, for as bright as predicted."""
        self._known[shot.role, shot.setting] = deque([1.0], REMEMBERED)
