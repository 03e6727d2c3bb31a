"""Whether anything moved while a code was captured, told by its pairs of a pattern and its inverse.

Light adds up: both together show the scene in even light, once for every pair, and their difference shows
where the pattern is on it. So every pair is held against the first one, and the differences of a later
setting against those of the first.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.motion import Floats, Movement, binned, movement_in
from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.plan import CapturePlan, NoCode, Shot
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import raw_variance

#: A pixel with less light than this share of the most tells nothing; so many others are needed.
DARK, FEWEST = 0.02, 100
#: The least motion that is told, px. Pairs of real captures differ by up to .27 px: their light is not quite
#: even where stripes meet.
LEAST_PX = 0.5
#: Wider pictures are averaged over larger blocks, so that comparing costs no more than saving.
WIDE_PX = 1000
#: Variance of what saturates, DN^2.
_UNKNOWN = 1e9


class PairWatch:
    """Takes the frames of a code in any order, and says between which of them something has moved."""

    def __init__(self, plan: CapturePlan, sensor: Sensor) -> None:
        """Nothing is watched in plans without a code of our own: nobody knows what makes a pair there."""
        self._sensor = sensor
        self._by = 2 * (1 + plan.camera_size_px[0] // WIDE_PX)
        ours = not isinstance(plan.code, NoCode | CapturedCode)
        self._shots = {s.index: s for s in plan.shots() if ours and s.role == "code"}
        self._half: dict[tuple[int, int], NDArray[np.uint16]] = {}
        self._first: tuple[tuple[int, int], Floats, Floats] | None = None
        self._difference: tuple[Floats, Floats] | None = None
        self._count, self._stripes = plan.code_count, plan.sentinel_code // 2
        self._still = -1
        self._moved_at: int | None = None

    @property
    def wanted(self) -> frozenset[int]:
        """Indices of the shots that are looked at."""
        return frozenset(self._shots)

    def add(self, shot: Shot, pixels: NDArray[np.uint16]) -> Movement | None:
        """What moved up to this frame (rows, columns), DN, since the first pair; None if nothing did.

        A pair is believed once the next one, if there is one, says so too: of the pair within which the
        motion came, one half shows the scene before it.
        """
        if shot.index not in self._shots:
            return None
        number, is_inverse = divmod(shot.pattern, 2)
        other = self._half.pop((shot.setting, shot.pattern ^ 1), None)
        if other is None:
            self._half[shot.setting, shot.pattern] = pixels
            return None
        pair = (other, pixels) if is_inverse else (pixels, other)
        found = self._compare((shot.setting, number), *self._light(*pair))
        if found is None:
            self._still, self._moved_at = max(self._still, shot.index - 1), None
            return None
        first, self._moved_at = self._moved_at or shot.index, self._moved_at or shot.index
        is_sure = found.is_pattern or first < shot.index or shot.pattern >= self._count - 2
        return replace(found, after=self._still, before=first) if is_sure else None

    def _light(self, one: NDArray[np.uint16], other: NDArray[np.uint16]) -> tuple[Floats, Floats, Floats]:
        """Light of a pattern, that of its inverse, and the variance of their sum, all binned."""
        level, full = self._sensor.black_level_dn, 0.98 * self._sensor.full_scale_dn
        light = [each.astype(np.float64) - level for each in (one, other)]
        noise = sum(raw_variance(self._sensor, each) for each in light)
        sound = (one < full) & (other < full)
        variance = np.asarray(np.where(sound, noise, 1e3 * _UNKNOWN), np.float64)
        return (
            binned(light[0], self._by),
            binned(light[1], self._by),
            binned(variance, self._by) / self._by**2,
        )

    def _compare(
        self, which: tuple[int, int], one: Floats, other: Floats, variance: Floats
    ) -> Movement | None:
        if self._first is None or self._first[0] == which:  # or it was captured again
            self._first = which, one + other, variance
            return None
        _, even, first_variance = self._first
        noise = np.maximum(variance, first_variance)
        factors = _factors(one, other, even, noise < _UNKNOWN)
        if factors is None:
            return None
        scaled = factors[0] * one, factors[1] * other
        noise = first_variance + variance * max(factors) ** 2
        found = self._movement(even, scaled[0] + scaled[1], noise)
        if found is not None or which[1] != self._stripes:
            return found
        difference = scaled[0] - scaled[1]
        if self._difference is None:
            self._difference = difference, noise
            return None
        before, old_noise = self._difference
        return self._movement(before, difference, old_noise + noise, is_pattern=True)

    def _movement(self, old: Floats, new: Floats, noise: Floats, is_pattern: bool = False) -> Movement | None:
        return movement_in(old, np.where(noise < _UNKNOWN, new, old), noise, self._by, is_pattern, LEAST_PX)


def _factors(
    one: Floats, other: Floats, even: Floats, sound: NDArray[np.bool_]
) -> tuple[float, float] | None:
    """What to scale a pair with for its sum to be even light; None where it shows too little."""
    used = sound & (even > DARK * float(even.max()))
    if int(used.sum()) < FEWEST:
        return None
    light = np.stack([one[used], other[used]])
    matrix = light @ light.T
    if np.linalg.cond(matrix) > 1e6:
        return None
    first, second = (float(each) for each in np.linalg.solve(matrix, light @ even[used]))
    return (first, second) if first > 0 and second > 0 else None
