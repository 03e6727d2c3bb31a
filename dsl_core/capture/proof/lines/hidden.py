"""Whether something has come between the scene and the camera, or between a lamp of the room and the scene.

No line takes light away: where its picture is darker than black, light of the room is missing. All of the
room may have become darker, which changes most pixels alike; a part of the picture has not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.capture.proof.recent import Recent
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE
from dsl_core.solve.ranks import median

#: A pixel is darker by so many deviations, and by this share of what the room gives it.
SIGMAS, SHARE = 4.0, 0.35
#: So many pixels that the line before left as they were, as a share of all and at least.
FEWEST_SHARE, FEWEST = 0.01, 12
#: Nobody stands there where another colour has less than this share of the dark pixels of the one with most.
#: Of each colour, as many pixels have to tell as this share of the dark ones.
OTHERS, FEWEST_TELLING = 0.2, 0.1
#: What is dark reaches so far along a row, and to the row above and below, which have all colours together.
NEAR_PX = 2
_NOTHING = np.float32(0)


class HiddenParts:
    """Compares lines with black and with the lines before them."""

    def __init__(self, noise: Noise) -> None:
        """Start without any line."""
        self._noise = noise
        self._before: tuple[int, Counts, Counts] | None = None
        self._limits = Recent[Floats]()

    def is_hidden(self, setting: int, seen: Counts, black: Counts) -> bool:
        """Whether a part of a line is darker than black that was not in the line before of this setting.

        What was dark there already says more of black, which may have been too bright. A picture in which
        nothing is hidden is remembered for the next.
        """
        fewest = max(FEWEST, FEWEST_SHARE * seen.size)
        found = False
        # Most lines have too few pixels as dark, whatever the noise and the room have become.
        limit = self._limits.get(setting, (black,), lambda: self._limit(black))
        if np.count_nonzero(seen < limit) >= fewest and int(self._darker(seen, black).sum()) >= fewest:
            dark = self._dark(seen, black)
            known = self._before is not None and self._before[0] == setting
            before = self._dark(*self._before[1:]) if self._before is not None and known else dark
            found = int((dark & ~before).sum()) >= fewest
        if not found:
            self._before = setting, seen, black
        return found

    def colours(
        self, seen: Counts, black: Counts, channels: NDArray[np.int8], columns: int
    ) -> tuple[int, ...]:
        """The colours that alone are darker than black; none where all of them are, as if hidden.

        ``channels`` has the colour of each pixel, in rows of so many ``columns``.
        """
        dark = self._dark(seen, black)
        # Where the room gives too little, nobody sees that it is gone; nor does anybody away from what is.
        room = np.subtract(black, np.float32(self._noise.sensor.black_level_dn), dtype=np.float32)
        tells = (room > 2 * SIGMAS * self._sigma(seen, black)) & _beside(dark, columns)
        each_tells = {int(each): tells & (channels == each) for each in np.unique(channels)}
        if min(int(own.sum()) for own in each_tells.values()) < max(FEWEST, FEWEST_TELLING * dark.sum()):
            return ()
        share = {each: float(dark[own].mean()) for each, own in each_tells.items()}
        few = OTHERS * max(share.values())
        return tuple(each for each in share if share[each] > few) if min(share.values()) <= few else ()

    def _limit(self, black: Counts) -> Floats:
        """Counts below which pixels may be darker than black, as no picture has less noise."""
        room = np.subtract(black, np.float32(self._noise.sensor.black_level_dn), dtype=np.float32)
        noise = SIGMAS * np.sqrt(self._noise.variance(black) + np.float32(self._noise.least_variance))
        return np.asarray(black - np.maximum(SHARE * room, noise))

    def _darker(
        self, seen: Counts, black: Counts, room_dn: np.float32 = _NOTHING, more: float = 1.0
    ) -> NDArray[np.bool_]:
        """Pixels darker than black, of which the room has lost so many DN, by ``more`` noise than stated."""
        room = np.subtract(black, np.float32(self._noise.sensor.black_level_dn), dtype=np.float32)
        lost = np.subtract(black, seen, dtype=np.float32)
        lost -= room_dn
        return np.asarray((lost > SHARE * room) & (lost > SIGMAS * more * self._sigma(seen, black)))

    def _dark(self, seen: Counts, black: Counts) -> NDArray[np.bool_]:
        """The same, by what the picture says itself of noise and room."""
        lost, sigma = np.subtract(black, seen, dtype=np.float32), self._sigma(seen, black)
        # A camera that has more noise than it is said to have says so itself, by pixels of one colour beside
        # each other: a shadow over half of the picture is no noise.
        step = np.abs(lost[2:] - lost[:-2]) / np.hypot(sigma[2:], sigma[:-2])
        more = max(STD_OF_MEDIAN_SIZE * float(median(step)), 1.0)
        return self._darker(seen, black, max(median(lost), _NOTHING), more)

    def _sigma(self, seen: Counts, black: Counts) -> Floats:
        return np.asarray(np.sqrt(self._noise.variance(seen) + self._noise.variance(black)))


def _beside(dark: NDArray[np.bool_], columns: int) -> NDArray[np.bool_]:
    """Pixels that are dark themselves, or have a dark one near them in their row or the row beside it."""
    found = dark
    for step in (*[1] * NEAR_PX, columns):
        before, found = found, found.copy()
        found[step:] |= before[:-step]
        found[:-step] |= before[step:]
    return found
