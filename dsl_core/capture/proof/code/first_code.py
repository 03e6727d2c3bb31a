"""Pictures of the first code of a scan, judged by each other: nothing else is known yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import CodePairs, Pair, alike, dominant
from dsl_core.capture.proof.code.columns import LEAST_MARGIN, decode, exchanged_pairs, run_backwards
from dsl_core.capture.proof.code.first_light import (
    FEWEST_LIT,
    SETTLED,
    changed_light,
    has_moved,
    is_unlit,
    light_of_first,
    light_of_pairs,
    light_of_words,
    unsettled_pairs,
    unsettled_words,
)
from dsl_core.capture.proof.contest import vote
from dsl_core.capture.proof.finding import Finding, Verdict, displaced
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts, Floats, Raster
from dsl_core.model.plan import BinaryCode, CapturePlan, Shot, spoken_number
from dsl_core.patterns.displaced_code import DisplacedCode, displaced_code

#: Share of saturated pixels from which on a picture tells nothing, and up to which other pictures do.
ALL_SATURATED, SOME_SATURATED = 0.98, 0.7


class FirstCode:
    """The code, white and black of one setting, as far as they are there."""

    def __init__(
        self, plan: CapturePlan, code: BinaryCode, shots: Sequence[Shot], raster: Raster, noise: Noise,
        bayer: str, rises: bool | None, at_the_end: bool = False,
    ) -> None:  # fmt: skip
        """Judge ``shots``, those of the code, white and black of one setting.

        ``rises`` says whether columns of the projector rise with those of the camera, None if unknown.
        ``at_the_end``: pairs are judged by all others, once all are there, rather than by those before.
        """
        self._plan, self._code, self._noise, self._raster = plan, code, noise, raster
        self._channels = raster.channels(bayer)
        self._rises = rises
        self._shots = {(shot.role, shot.pattern): shot for shot in shots}
        self._pairs = CodePairs(noise)
        self._half: dict[int, Counts] = {}
        self._ends: dict[str, Counts] = {}
        self._lit: Lit | None = None
        #: Pictures of the first two pairs as they were before both were taken again, by pattern.
        self._disputed: dict[int, Counts] = {}
        self._at_the_end, self._is_believed, self._is_settled = at_the_end, False, False
        #: Light of pairs over that of white, by number, where it differs, and of the first where it was taken
        #: again for that.
        self.light: dict[int, float] = {}
        self.settled = 1.0
        #: What the last look at all pairs together found.
        self.reviewed: list[Finding] = []

    @property
    def lit(self) -> Lit | None:
        """Pixels whose column is known, once all pictures are there and fit each other."""
        if self._lit is None and not self._missing and "white" in self._ends and "black" in self._ends:
            self._lit = self._located()
        return self._lit

    @property
    def says_nothing(self) -> bool:
        """Whether all of it is there, and in too few pixels white is neither dark nor saturated."""
        if self._missing or len(self._ends) < 2:
            return False
        return int(self._light()[2].sum()) < FEWEST_LIT

    @property
    def _missing(self) -> bool:
        return 2 * len(self._pairs.pairs) < self._plan.code_count

    def add(self, shot: Shot, seen: Counts, before: Counts | None) -> Finding:
        """Judge a picture, given that of the shot taken before it, and keep it where it may be right."""
        self._lit, self.reviewed = None, []
        found = self._add_half(shot, seen) if shot.role == "code" else self._add_end(shot, seen, before)
        if found.is_wrong:
            return found
        whole = not self._missing and len(self._ends) == 2
        return (self._review(shot) or found) if whole else found

    def forget(self, shot: Shot) -> None:
        """Forget the picture of a shot that seemed right; the other one of its pair is kept for the next."""
        self._lit = None
        self._ends.pop(shot.role, None)
        if shot.role == "code":
            number, inverse = divmod(shot.pattern, 2)
            pair = self._pairs.pairs.pop(number, None)
            self._half.pop(shot.pattern, None)
            if pair is not None:
                self._half[2 * number + 1 - inverse] = pair[1 - inverse]

    def _add_half(self, shot: Shot, seen: Counts) -> Finding:
        number, inverse = divmod(shot.pattern, 2)
        self._pairs.pairs.pop(number, None)  # a pair is taken again as a whole
        other = self._half.pop(2 * number + 1 - inverse, None)
        if other is None:
            self._half[shot.pattern] = seen
            return Finding(shot, Verdict.UNTOLD)
        pair = (other, seen) if inverse else (seen, other)
        again = self._pair_shots(number)
        self._pairs.learn_noise(pair, self._raster)
        expected = None if self._at_the_end else self._pairs.sum()
        broken = self._pairs.broken(pair, expected)
        if broken is not None and expected is not None:
            if len(self._pairs.pairs) == 1 and not self._ends:
                # Nobody knows which of two is wrong.
                first = next(iter(self._pairs.pairs))
                again = (*self._pair_shots(first), *again)
                self._disputed = self._disputed or self._by_pattern({**self._pairs.pairs, number: pair})
                self._pairs.pairs.pop(first)
            verdict, detail = self._explain(pair, expected, broken)
            return Finding(shot, verdict, again, detail)
        self._pairs.pairs[number] = pair
        wrong = None if self._at_the_end else self._blinding(shot) or self._changed_first(shot)
        if wrong is not None:
            for each in wrong.again:
                self._pairs.pairs.pop(each.pattern // 2, None)
            return wrong
        is_told = expected is not None and int(self._pairs.contrast()[2].sum()) >= FEWEST_LIT
        return Finding(shot, Verdict.RIGHT if is_told else Verdict.UNTOLD)

    def _blinding(self, shot: Shot) -> Finding | None:
        """Whether the first pair is saturated as the second is not: no other could be judged by it."""
        if len(self._pairs.pairs) != 2:
            return None
        full = self._noise.sensor.full_scale_dn
        first, second = (
            max(float((seen >= full).mean()) for seen in pair) for pair in self._pairs.pairs.values()
        )
        if first < ALL_SATURATED or second > SOME_SATURATED:
            return None
        return Finding(shot, Verdict.SATURATED, self._pair_shots(next(iter(self._pairs.pairs))))

    def _changed_first(self, shot: Shot) -> Finding | None:
        """Whether light or picture changed before two pairs were right: both wrong alike, they fit."""
        numbers = list(self._pairs.pairs)
        pairs = self._pairs.pairs.values()
        if len(numbers) == 2 and all(is_unlit(*pair, self._noise, self._raster) for pair in pairs):
            again = tuple(each for number in sorted(numbers) for each in self._pair_shots(number))
            return Finding(shot, Verdict.DARK, again, "neither it nor its inverse lights anything in view")
        if not self._disputed or not {pattern // 2 for pattern in self._disputed} <= set(numbers):
            return None
        now = self._by_pattern(self._pairs.pairs)
        again = tuple(self._shots["code", pattern] for pattern in sorted(self._disputed))
        first = again[0].pattern
        before = self._disputed[first], self._disputed[first + 1]
        if has_moved(before, (now[first], now[first + 1]), self._noise):
            return Finding(shot, Verdict.DISPLACED, again)
        ratio = changed_light(self._disputed, now, self._noise, self._channels)
        if ratio is None:
            # No other picture tells whether it was the light or this one that was wrong.
            self.settled = light_of_first(self._disputed, now, self._noise, self._channels)
            self._disputed = {}
            return None
        return Finding(shot, Verdict.EXPOSURE, again, f"{ratio:.2g} times that of the first pictures")

    @staticmethod
    def _by_pattern(pairs: Mapping[int, Pair]) -> dict[int, Counts]:
        return {2 * n + inverse: seen for n, pair in pairs.items() for inverse, seen in enumerate(pair)}

    def _add_end(self, shot: Shot, seen: Counts, before: Counts | None) -> Finding:
        self._ends.pop(shot.role, None)
        if not self._pairs.pairs:
            self._ends[shot.role] = seen
            return Finding(shot, Verdict.UNTOLD)
        dark, bright, lit = self._pairs.contrast()
        if int(lit.sum()) < FEWEST_LIT:
            self._ends[shot.role] = seen
            return Finding(shot, Verdict.UNTOLD)
        wanted, rival = (bright, dark) if shot.role == "white" else (dark, bright)
        result = vote(seen[lit].astype(np.float32), wanted[lit], rival[lit])
        if result.is_lost or result.is_torn:
            late = before is not None and alike(seen, before, bright - dark, lit)
            torn = Verdict.TORN if result.is_torn and not result.is_lost else Verdict.OTHER
            if shot.role == "white" and result.mean < -0.5:
                torn = Verdict.DARK
            return Finding(
                shot, Verdict.LATE if late else torn, (shot,), self._like(seen, bright - dark, lit)
            )
        expected, other = self._pairs.sum(), self._ends.get("black" if shot.role == "white" else "white")
        if other is not None and len(self._pairs.pairs) > 2:
            pair = (seen, other)
            broken = self._pairs.broken(pair, expected)
            if broken is not None and expected is not None:
                verdict, detail = self._explain(pair, expected, broken)
                return Finding(shot, verdict, (self._shots["white", 0], self._shots["black", 0]), detail)
        self._ends[shot.role] = seen
        return Finding(shot, Verdict.RIGHT)

    def _review(self, shot: Shot) -> Finding | None:
        """Judge all pairs by the sum that most of them have, then the columns that they give."""
        expected = self._pairs.sum()
        self.reviewed = []
        for number, pair in list(self._pairs.pairs.items()):
            broken = self._pairs.broken(pair, expected)
            if broken is not None and expected is not None:
                verdict, detail = self._explain(pair, expected, broken)
                self.reviewed.append(Finding(shot, verdict, self._pair_shots(number), detail))
        if not self.reviewed:
            self.reviewed = self._unsettled(shot)
        if not self.reviewed:
            numbers = () if self._is_believed else self._exchanged()
            if numbers:
                # Taken again with the same result, it is what there is to see.
                self._is_believed = True
                again = tuple(each for number in numbers for each in self._pair_shots(number))
                detail = "pattern and inverse exchanged"
                self.reviewed.append(Finding(shot, Verdict.SWAPPED, again, detail))
            elif self._is_mirrored():
                again = tuple(each for number in self._pairs.pairs for each in self._pair_shots(number))
                self.reviewed.append(Finding(shot, Verdict.MIRRORED, again))
            elif (since := self._displaced()) is not None:
                self.reviewed.append(self._since(shot, since))
        if not self.reviewed:
            return None
        for each in self.reviewed:
            for wrong in each.again:
                self._pairs.pairs.pop(wrong.pattern // 2, None)
        again = tuple(wrong for each in self.reviewed for wrong in each.again)
        return replace(self.reviewed[0], again=again)

    def _unsettled(self, shot: Shot) -> list[Finding]:
        """Pairs that were taken in other light than white and black were, as while a lamp warms up.

        Taken again with the same result, the light is what it is: it is measured, and corrected for, later.
        """
        _, _, lit = self._pairs.contrast()
        ends = self._ends["white"], self._ends["black"]
        light = light_of_pairs(self._pairs.pairs, ends, lit, self._noise)
        found: dict[int, float] = {}
        if not (self._at_the_end or self._is_settled):
            self._is_settled = True
            found = unsettled_pairs(light)
            first = found.get(min(light, default=0), 1.0)
            self.settled = first if abs(first - 1) > SETTLED else self.settled
        self.light = {n: each for n, each in light.items() if n not in found and abs(each - 1) > SETTLED}
        return [
            Finding(shot, Verdict.EXPOSURE, self._pair_shots(number), unsettled_words(ratio))
            for number, ratio in found.items()
        ]

    def recall(self, shot: Shot, why: str) -> None:
        """Take over, from ``why`` an earlier run captured a shot again, what light it had before."""
        light = light_of_words(why)
        if shot.role == "code" and shot.pattern < 2 and light is not None and abs(light - 1) > SETTLED:
            self.settled = light

    def _exchanged(self) -> tuple[int, ...]:
        _, _, lit = self._pairs.contrast()
        size_px, pairs, raster = self._plan.projector_size_px, self._pairs.pairs, self._raster
        # Columns jump at edges of an exchanged pair, where pixels see both sides. Without these pixels, only
        # a calibration, which says how columns rise, tells it.
        trusted = lit if self._rises is None else lit & self._margins()
        return exchanged_pairs(self._code, size_px, pairs, trusted, raster.shape, self._rises, raster.rows_px)

    def _is_mirrored(self) -> bool:
        if self._rises is None:
            return False
        _, _, lit = self._pairs.contrast()
        size_px, pairs, raster = self._plan.projector_size_px, self._pairs.pairs, self._raster
        trusted = lit & self._margins()
        return run_backwards(self._code, size_px, pairs, trusted, raster.shape, self._rises, raster.rows_px)

    def _displaced(self) -> DisplacedCode | None:
        _, _, lit = self._pairs.contrast()
        column, _ = decode(self._code, self._plan.projector_size_px, self._pairs.pairs)
        known = np.where(lit & self._margins(), column, -1).reshape(self._raster.shape)
        return displaced_code(self._code, self._plan.projector_size_px, known)

    def _since(self, shot: Shot, code: DisplacedCode) -> Finding:
        """That a code is displaced since one of its pairs; white and black look the same everywhere."""
        numbers = [number for number in sorted(self._pairs.pairs) if number >= code.since_pair]
        again = tuple(each for number in numbers for each in self._pair_shots(number))
        return displaced(shot, again, code.columns)

    def substitute(self, number: int, pair: Pair) -> None:
        """Take a pair of another setting for a wrong one: for the columns alone."""
        self._pairs.pairs[number] = pair
        self._lit = None

    @property
    def lacking(self) -> tuple[int, ...]:
        """Pairs that are not there, or were found wrong."""
        return tuple(n for n in range(self._plan.code_count // 2) if n not in self._pairs.pairs)

    def _margins(self) -> NDArray[np.bool_]:
        dark, bright, _ = self._pairs.contrast()
        _, margin = decode(self._code, self._plan.projector_size_px, self._pairs.pairs)
        return np.asarray(margin > LEAST_MARGIN * (bright - dark))

    def _located(self) -> Lit | None:
        contrast, sigma, sound = self._light()
        column, margin = decode(self._code, self._plan.projector_size_px, self._pairs.pairs)
        index = np.flatnonzero(sound & (column >= 0) & (margin > LEAST_MARGIN * contrast))
        if index.size < FEWEST_LIT:
            return None
        key = (3 * column[index] + self._channels[index]).astype(np.intp)
        black = self._ends["black"][index].astype(np.float32)
        return Lit(index, key, black, contrast[index], sigma[index])

    def _light(self) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """White less black, its deviation, and where that says enough."""
        white, black = self._ends["white"], self._ends["black"]
        contrast = white.astype(np.float32) - black.astype(np.float32)
        sigma = np.sqrt(self._noise.variance(white) + self._noise.variance(black))
        # Where white saturates, nobody knows how bright a line and the blur beside it will be.
        return contrast, sigma, (contrast > 12 * sigma) & (white < self._noise.sensor.full_scale_dn)

    def _explain(self, pair: Pair, expected: Floats, broken: NDArray[np.bool_]) -> tuple[Verdict, str]:
        """What a pair that breaks the sum shows instead."""
        if np.array_equal(*pair):
            return Verdict.REPEATED, ""
        ratios = self._pairs.brightness(pair, expected)
        if ratios is not None:
            worst = min(ratios, key=lambda ratio: -abs(np.log(ratio)))
            return Verdict.EXPOSURE, f"{worst:.2g} times what was expected"
        dark, bright, lit = self._pairs.contrast([pair])
        if alike(*pair, bright - dark, lit):
            return Verdict.LATE, ""
        shown = [words for picture in pair if (words := self._like(picture, bright - dark, lit))]
        return (Verdict.LATE, shown[0]) if shown else (dominant(broken, lit), "")

    def _like(self, seen: Counts, contrast: Floats, lit: NDArray[np.bool_]) -> str:
        """Which pattern of the pairs that are right a picture shows, in words; empty if none."""
        for pattern, other in self._by_pattern(self._pairs.pairs).items():
            if other is not seen and alike(seen, other, contrast, lit):
                return f"like code pattern {spoken_number(pattern)}"
        return ""

    def _pair_shots(self, number: int) -> tuple[Shot, ...]:
        return self._shots["code", 2 * number], self._shots["code", 2 * number + 1]
