"""What the witnesses of the light say, each as it is heard and all of them as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Scatter that remains where nothing flickers.
QUIET = 0.002


@dataclass(frozen=True)
class Witness:
    """The logarithm of the light of one shot over that of another one, and its deviation.

    Shots are named by their index; ``against`` None is white as it was merged, of unknown level. ``slope``
    is what a witness may be wrong by in common with others, as a multiple of one unknown. ``setting`` is the
    place of the shot's setting if it is compared with the same pattern at the last one.
    """

    shot: int
    against: int | None
    log: float
    std: float
    slope: float = 0.0
    setting: int | None = None


@dataclass(frozen=True)
class Heard:
    """What all witnesses say, an array (witnesses,) for each of their figures.

    ``against`` and ``setting`` are -1 where a witness has none.
    """

    shot: Ints
    against: Ints
    log: Floats
    std: Floats
    slope: Floats
    setting: Ints

    @classmethod
    def of(cls, witnesses: Sequence[Witness]) -> Heard:
        """What so many witnesses say."""
        return cls(
            np.array([each.shot for each in witnesses], int),
            np.array([-1 if each.against is None else each.against for each in witnesses], int),
            np.array([each.log for each in witnesses], float),
            np.array([each.std for each in witnesses], float),
            np.array([each.slope for each in witnesses], float),
            np.array([-1 if each.setting is None else each.setting for each in witnesses], int),
        )

    def some(self, which: NDArray[np.bool_]) -> Heard:
        """What those witnesses say."""
        return Heard(*(getattr(self, each.name)[which] for each in fields(self)))

    def __len__(self) -> int:
        return self.shot.size

    @property
    def of_lamp(self) -> NDArray[np.bool_]:
        """Which witnesses saw one pattern twice at one setting: the light itself."""
        return (self.against >= 0) & (self.setting < 0)

    @property
    def settings(self) -> int:
        """How many settings are compared with the last one."""
        return int(self.setting.max(initial=-1)) + 1

    @property
    def own_variance(self) -> Floats:
        """The variance of each that is its own, without flicker."""
        return self.std**2 + QUIET**2

    @property
    def flickering(self) -> Floats:
        """Of how many shots the flicker is in each."""
        return np.where(self.against < 0, 1.0, 2.0)

    def design(self, shots: int, step_at: int | None) -> Floats:
        """How each depends on the terms of a course (witnesses, terms).

        They are linear and quadratic drift, white, slope, settings, and the step at ``step_at`` if any.
        """
        last, against_white = max(shots - 1, 1), self.against < 0
        time, other = self.shot / last, np.where(against_white, 0.0, self.against / last)
        terms = [time - other, time**2 - other**2, np.where(against_white, -1.0, 0.0), self.slope]
        terms += [(self.setting == each).astype(float) for each in range(self.settings)]
        if step_at is not None:
            terms.append(self.step(step_at))
        return np.stack(terms, 1)

    def step(self, at: int | NDArray[np.intp]) -> Floats:
        """How each depends on a step at a shot (witnesses,); of shots (places, 1): (places, witnesses)."""
        return np.asarray((self.shot >= at).astype(float) - (self.against >= at))
