"""Whether an old shot, taken again, shows its pattern: its own picture of before says how it should look.

What has moved since is not for this module: a sentinel that looks the same wrong way twice is believed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.finding import Finding, Verdict, of_another_pattern
from dsl_core.capture.proof.late_colour import late_colour
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Expected, contest_of_pictures
from dsl_core.capture.proof.raster import Counts, Floats, Raster
from dsl_core.model.plan import Shot

#: Mean vote below which a picture may be mixed with another one. Light may have changed by a seventh.
MIXED = 0.5
#: So many takes of one sentinel may be refused.
REFUSALS = 2


class SentinelProof:
    """Judges sentinels by the pictures that they repeat."""

    def __init__(self, noise: Noise, raster: Raster, channels: NDArray[np.int8]) -> None:
        """For pictures of this raster, ``channels`` the colours of their pixels: 0 red, 1 green, 2 blue."""
        self._noise, self._raster, self._channels = noise, raster, channels
        self._refused: dict[int, int] = {}

    def judge(
        self, shot: Shot, seen: Counts, old: Counts | None, black: Counts | None, rivals: Iterable[Counts]
    ) -> Finding:
        """Compare with the ``old`` picture; the first of the ``rivals`` is that of the shot before."""
        if old is None or black is None:
            return Finding(shot, Verdict.UNTOLD)
        dark, wanted = black.astype(np.float32), self._expected(old)
        verdicts = [Verdict.LATE, *[Verdict.OTHER] * 8]
        told = False
        for verdict, rival in zip(verdicts, rivals, strict=False):
            found = contest_of_pictures(
                seen, wanted, self._expected(rival), dark, np.zeros_like(dark), self._noise, self._raster
            )
            told |= found.is_told
            if found.is_lost or found.is_torn or found.is_doubtful:
                return self._refuse(Finding(shot, verdict if found.is_lost else Verdict.TORN, (shot,)))
            colour = late_colour(seen, old, rival, black, self._channels, self._noise)
            if colour:
                detail = of_another_pattern(colour)
                return self._refuse(Finding(shot, Verdict.TORN, (shot,), detail, colour=colour))
            if self._is_mixed(seen, old, rival, dark):
                detail = "it is mixed with another pattern, or its light has changed"
                return self._refuse(Finding(shot, Verdict.TORN, (shot,), detail))
        return Finding(shot, Verdict.RIGHT if told else Verdict.UNTOLD)

    def _is_mixed(self, seen: Counts, old: Counts, rival: Counts, dark: Floats) -> bool:
        """Whether pixels that did not saturate hold another picture too; others would be bright anyway."""
        expected, saturated = self._expected(old), old >= self._noise.sensor.full_scale_dn
        wanted = replace(expected, variance=np.where(saturated, np.float32(np.inf), expected.variance))
        found = contest_of_pictures(
            seen, wanted, self._expected(rival), dark, np.zeros_like(dark), self._noise, self._raster
        )
        return found.is_told and found.mean < MIXED

    def _refuse(self, found: Finding) -> Finding:
        """A finding on a sentinel that is wrong, but for one that stays so."""
        index = found.shot.index
        self._refused[index] = self._refused.get(index, 0) + 1
        return found if self._refused[index] <= REFUSALS else Finding(found.shot, Verdict.UNTOLD)

    def _expected(self, picture: Counts) -> Expected:
        return Expected(picture.astype(np.float32), self._noise.variance(picture))
