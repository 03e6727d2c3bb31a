"""Whether lines had other light than those before and after them: a torch, a door, a hand in the way.

From line to line, the light of first orders moves through the picture, so that means over parts of it change
little by little. Light that comes and goes changes them at once, and back. What only comes may be a black
level that has changed, which black pictures tell. Surfaces that light each other may do the same for a line:
it looks like that whenever it is captured, so that one of them is captured once more.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace

import numpy as np

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.model.plan import Shot

#: Parts of a picture down and across, and columns beside a line that it may light.
PARTS, BESIDE = 4, 6
#: Share of its pixels that a part needs, and so many: those of a narrow strip have first orders all at once.
FEWEST_SHARE, FEWEST = 0.2, 24
#: Lines whose changes say what is usual, fewest of them, and lines whose median change goes on.
USUAL_OF, FEWEST_USUAL, TREND_OF = 7, 3, 3
#: A change is sudden from so many times the usual on, so many deviations, and so many DN. Clean scans of most
#: scenes stay below 2.4 times the usual; where surfaces light each other, lines change by up to 12 times.
SUDDEN, SIGMAS, LEAST_DN = 2.5, 7.0, 0.75
#: It went back if this share of it is left, and within so many lines.
LEFT, MOST_LINES = 0.5, 16


@dataclass(frozen=True)
class _Step:
    """Change of the parts from the line before to that of ``shot``, and beyond what it was before, DN.

    ``size_dn`` is the largest of the latter.
    """

    shot: Shot
    change: Floats
    jump: Floats
    size_dn: float
    is_sudden: bool


class PassingLight:
    """Remembers how parts of the picture changed from line to line."""

    def __init__(self, known: Known) -> None:
        """``known`` grows as pictures come."""
        self._known = known
        self._steps: list[_Step] = []
        self._first: tuple[_Step, Shot] | None = None
        self._lines_of: dict[int, list[Shot]] = {}
        rows, columns = known.raster.shape
        down, across = np.arange(rows) * PARTS // rows, np.arange(columns) * PARTS // columns
        self._parts = (down[:, None] * PARTS + across).ravel()
        self._fewest = np.maximum(FEWEST_SHARE * np.bincount(self._parts, minlength=PARTS**2), FEWEST)

    def judge(self, shot: Shot, seen: Counts) -> Finding | None:
        """That lines before this one seem to have had other light than it and those before them, or None."""
        known = self._known
        # Lines that are captured again are compared with those before them.
        steps = [s for s in self._steps if s.shot.setting == shot.setting and s.shot.index < shot.index]
        self._steps = steps
        lines = self._lines(shot.setting)
        lines = lines[: bisect_left(lines, shot.index, key=_place)]
        before = known.kept.get(lines[-1].index) if lines else None
        if before is None or known.lit is None:
            return None
        change, std = self._change((shot, seen), (lines[-1], before), known.lit)
        trend = np.median([each.change for each in steps[-TREND_OF:]], axis=0) if steps else change
        usual = [each.size_dn for each in steps if not each.is_sudden][-USUAL_OF:]
        least = max(SUDDEN * max(usual, default=0.0), SIGMAS * float(np.nan_to_num(std).max()), LEAST_DN)
        jump = np.nan_to_num(change - trend)
        size_dn = float(np.abs(jump).max())
        is_sudden = len(usual) >= FEWEST_USUAL and size_dn > least
        steps.append(_Step(shot, change, jump, size_dn, is_sudden))
        first = _since(steps, lines) if is_sudden else None
        if first is None:
            return None
        # If it is the scene, the lines after it are as sudden.
        self._steps = [replace(each, is_sudden=False) for each in steps]
        again = tuple(each for each in lines if each.index >= first.shot.index)
        self._first = first, lines[lines.index(first.shot) - 1]
        most = float(first.jump[np.abs(first.jump).argmax()])
        return Finding(shot, Verdict.PASSING, again, f"up to {most:+.1f} DN on the mean of a part")

    def _lines(self, setting: int) -> list[Shot]:
        """All lines of a setting, looked for once: there are hundreds, and each asks for those before it."""
        if setting not in self._lines_of:
            shots = self._known.shots
            self._lines_of[setting] = [s for s in shots if (s.role, s.setting) == ("spectral", setting)]
        return self._lines_of[setting]

    def is_past(self, seen: Counts) -> bool:
        """Whether the first of the lines last found, captured once more, has its light no longer."""
        lit = self._known.lit
        if self._first is None or lit is None:
            return False
        step, before = self._first
        old = self._known.kept.get(step.shot.index)
        if old is None:
            return False
        change = np.nan_to_num(self._change((step.shot, seen), (before, old), lit)[0])
        return float(change @ step.jump) < -LEFT * float(step.jump @ step.jump)

    def _change(
        self, now: tuple[Shot, Counts], before: tuple[Shot, Counts], lit: Lit
    ) -> tuple[Floats, Floats]:
        """By how much parts changed beside both lines, DN, with deviations; NaN for few pixels."""
        known, count = self._known, PARTS**2
        near = np.zeros(known.plan.projector_size_px[0])
        for shot, _ in (now, before):
            profile = known.profile(shot)
            near += 1.0 if profile is None else profile.reshape(-1, 3).sum(1)
        beside = np.convolve(near, np.ones(2 * BESIDE + 1), "same") > 0
        at = lit.index[~beside[lit.key // 3]]
        part, seen, old = self._parts[at], now[1][at], before[1][at]
        pixels = np.bincount(part, minlength=count)
        told = np.where(pixels >= self._fewest, pixels, np.nan)
        change = np.bincount(part, np.subtract(seen, old, dtype=np.float32), count)
        variance = np.bincount(part, known.noise.variance(seen) + known.noise.variance(old), count)
        return (change / told).astype(np.float32), (np.sqrt(variance) / told).astype(np.float32)


def _place(shot: Shot) -> int:
    return shot.index


def _since(steps: list[_Step], lines: list[Shot]) -> _Step | None:
    """The first sudden step of which the last one leaves little; None where it came to stay."""
    oldest = lines[-MOST_LINES:][0].index
    sudden = [each for each in steps if each.is_sudden and each.shot.index >= oldest]
    for number, first in enumerate(sudden[:-1]):
        left = np.sum([each.jump for each in sudden[number:]], axis=0)
        if abs(float(first.jump @ left)) < LEFT * float(first.jump @ first.jump):
            return first
    return None
