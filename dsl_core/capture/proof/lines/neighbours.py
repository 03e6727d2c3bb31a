"""Pictures of lines whose pixels nobody can name: a wrong one is unlike its neighbours in the plan.

From line to line, pictures differ by about as much as from the line before. One that suddenly does not, in
any part of its height, may be late, repeated or torn; one whose light suddenly changes may be dark or wrongly
exposed. That is a doubt, not a proof: surfaces end as suddenly.
"""

from __future__ import annotations

from collections import deque
from statistics import median

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.solve.robust import robust_std

Bands = NDArray[np.float64]
#: Parts of the height that are compared, coarse and fine, and lines that say what is usual. An eighth of a
#: picture that is late leaves a coarse part much of its change, and a fine one none.
BANDS, FINE, USUAL_OF, FEWEST_USUAL = 4, 16, 7, 3
#: Variance of a difference beyond noise, in units of that of noise: the least that says anything, of coarse
#: and of fine parts, whose few pixels are less certain.
LEAST_CHANGE, LEAST_FINE = 0.4, 1.0
#: A picture changes suddenly less if it changes by this share of the usual, in coarse and in fine parts.
LITTLE, LITTLE_FINE = 0.3, 0.1
#: Light relative to that of the lines before that is no surprise.
SAME_LINES = (0.6, 1.6)
#: Light counts from so many deviations on.
BRIGHT_SIGMAS = 25.0
#: Two pictures of one shot are different if all their light is by so many deviations, or more than so few
#: pixels by so many.
LIGHT_SIGMAS, FEW, SURE_SIGMAS = 5.0, 0.002, 6.0
#: Less than this share of its light is flicker.
FLICKER = 0.25
#: Deviation of the second difference of white noise, in its own.
SECOND_DIFFERENCE = 6**0.5
#: Differences count up to so many deviations.
_CLIP = 10.0


class LineNeighbours:
    """Compares pictures of lines with those right before them."""

    def __init__(self, noise: Noise, columns: int) -> None:
        """For rasters with so many ``columns``."""
        self._noise, self._columns = noise, columns
        self._before: tuple[int, Counts] | None = None
        self._changes: deque[Bands] = deque(maxlen=USUAL_OF)
        self._light: deque[float] = deque(maxlen=USUAL_OF)
        #: A picture of black, the sum of its counts and the deviation of two such sums.
        self._black: tuple[Counts, float, float] | None = None

    def is_doubtful(self, index: int, seen: Counts, black: Counts | None) -> bool:
        """Whether the picture of shot ``index`` is unlike those before it; remembers it for the next."""
        before, self._before = self._before, (index, seen)
        if before is None or before[0] + 1 != index:
            if before is None or before[0] != index:
                self._changes.clear()
                self._light.clear()
            return False
        change = self.change(seen, before[1])
        usual = self._usual()
        little, least = (
            _of_parts(change, *each) for each in ((LITTLE, LITTLE_FINE), (LEAST_CHANGE, LEAST_FINE))
        )
        if usual.size > BANDS:
            # Where lines share the few pixels of a fine part now and then, none is missed in it.
            usual[BANDS:] = np.min(self._changes, axis=0)[BANDS:]
        odd = (change < little * usual) & (usual > least)
        self._changes.append(change)
        return self._has_other_light(seen, black) or bool(odd.any())

    @property
    def are_few(self) -> bool:
        """Whether too few pictures were compared before the last to say whether that is usual."""
        return len(self._changes) <= FEWEST_USUAL

    def differ_at_first(self, one: Counts, other: Counts, black: Counts) -> bool:
        """Whether two pictures of one shot differ by more than noise, flicker and light of the room.

        That needs no neighbours: of two pictures of one pattern, all pixels together have the same light.
        """
        first, second = (np.subtract(each, black, dtype=np.float32) for each in (one, other))
        first, second = first - _of_most(first), second - _of_most(second)
        noise = np.sqrt(self._noise.variance(one) + self._noise.variance(other))
        step = first - second
        # Noise differs between pixels of one colour beside each other; another smooth pattern hardly does.
        z = step / noise
        sigma = max(float(robust_std(z[4:] - 2 * z[2:-2] + z[:-4])) / SECOND_DIFFERENCE, 1.0)
        lost = abs(float(step.sum()))
        is_dimmer = lost > FLICKER * max(abs(float(first.sum())), abs(float(second.sum())))
        is_dimmer &= lost > LIGHT_SIGMAS * sigma * float(np.sqrt((noise**2).sum()))
        gain = float(first @ second) / max(float(first @ first), 1e-9)
        gain = gain if abs(gain - 1) < FLICKER else 1.0
        left = np.abs(second - np.float32(gain) * first) / noise
        return is_dimmer or float((left > SURE_SIGMAS * sigma).mean()) > FEW

    def differ(self, one: Counts, other: Counts) -> bool:
        """Whether two pictures of one shot show different patterns, whatever light the room gives to each."""
        usual = self._usual()
        step = np.subtract(one, other, dtype=np.float32)
        change = self.change(one, other + _of_most(step))
        least = _of_parts(change, LEAST_CHANGE, LEAST_FINE)
        return bool(((change > 0.5 * usual) & (usual > least) & (change > least)).any())

    def change(self, one: Counts, other: Counts | NDArray[np.float32]) -> Bands:
        """Variance of the difference beyond noise, in units of that of noise, in every part of the height.

        The coarse parts come first; there are no more fine ones than rows.
        """
        step2 = np.subtract(one, other, dtype=np.float32)
        np.square(step2, out=step2)
        step2 /= self._noise.variance(one) + self._noise.variance(other)
        np.minimum(step2, np.float32(_CLIP**2), out=step2)
        rows = step2.reshape(-1, self._columns) @ np.full(self._columns, 1 / self._columns, np.float32)
        sums = np.append(0.0, np.cumsum(rows, dtype=np.float64))
        counts = (min(parts, rows.size) for parts in (BANDS, FINE))
        edges = (np.arange(count + 1) * rows.size // count for count in counts)
        return np.concatenate([np.diff(sums[at]) / np.diff(at) - 1 for at in edges])

    def _usual(self) -> Bands:
        if len(self._changes) < FEWEST_USUAL:
            return np.zeros(1)
        return np.asarray(np.median(self._changes, axis=0))

    def _has_other_light(self, seen: Counts, black: Counts | None) -> bool:
        if black is None:
            return False
        if self._black is None or self._black[0] is not black:
            noise = float(np.sqrt(2 * self._noise.variance(black).sum(dtype=np.float64)))
            self._black = black, float(black.sum()), noise
        _, dark, sigma = self._black
        light = float(seen.sum()) - dark
        usual = median(self._light) if len(self._light) >= FEWEST_USUAL else 0.0
        self._light.append(light)
        low, high = SAME_LINES
        enough = BRIGHT_SIGMAS * sigma
        # No line takes light away: below black, the exposure was shorter or the room is darker.
        is_below_black = light < min(usual, 0.0) - enough
        return is_below_black or (usual > enough and not low * usual < light < high * usual)


def _of_parts(changes: Bands, coarse: float, fine: float) -> Bands:
    """One value for the coarse parts and one for the fine ones of so many."""
    return np.where(np.arange(changes.size) < BANDS, coarse, fine)


def _of_most(light: NDArray[np.float32]) -> np.float32:
    """Mean of most pixels, without the brightest and the darkest; the median of whole counts jumps.

    Pixels are left out by rank: between two whole counts, limits would take in or leave out many of them.
    """
    low, high = int(0.1 * light.size), int(0.8 * light.size)
    return np.float32(np.sort(light)[low : high + 1].mean())
