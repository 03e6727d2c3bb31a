"""Which digits a run of stripe pictures shows: by smoothness of the numbers that each reading gives.

A wrong order of digits, a wrong code or pictures taken for their inverses make numbers go up and down along a
line; with the right reading, they run in one direction, but for the edges of things before the camera.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.captured_code import MOST_BITS, Stripes
from dsl_core.patterns.recognition.probes import Lines
from dsl_core.patterns.stripes import number_of

Inverse = Literal["none", "interleaved", "after"]
#: Pictures and their inverses go against each other at least this much.
COMPLEMENT = -0.6
#: Readings as rough as this are none.
ROUGH = 0.45
#: Fewer digits than this are smooth in every reading.
FEWEST_BITS = 3
#: Digits vary by this much where they are seen at all, and go together less than this.
LEAST_VARIANCE, REPEATED = 0.04, 0.93
#: A digit that is bright, or dark, in all but this share of the pixels is even.
EVEN = 0.02
#: Of two readings the second is this many times rougher, or which one it is stays unsure.
CLEARLY_ROUGHER = 1.5
#: A blurred digit adds nothing but noise, so rougher readings that only differ in it are as good.
FLOOR = 5e-3


_CODES: tuple[tuple[Literal["gray", "binary", "xor"], int], ...] = (
    ("gray", 0),
    ("binary", 0),
    ("xor", 0),
    ("xor", 1),
)


@dataclass(frozen=True)
class StripeReading:
    """How the pictures of a set are to be read, and how rough its numbers then are (0 to 1).

    ``rival`` is the roughness of the best reading that is another one, but for binary code read the other way
    round with its inverses; ``numbers`` are the least and the largest that are common. ``rises`` says whether
    they rise along the lines.
    """

    code: Literal["gray", "binary", "xor"]
    base_bit: int
    bits: int
    first: Literal["most", "least"]
    inverse: Inverse
    inverse_first: bool
    roughness: float
    rival: float
    numbers: tuple[int, int]
    rises: bool

    @property
    def is_sure(self) -> bool:
        """Whether no other reading comes close."""
        return self.rival > CLEARLY_ROUGHER * (self.roughness + FLOOR)


def read_set(lines: Lines, pictures: Sequence[int | None]) -> StripeReading | None:
    """The best reading of a run of pictures, None for those that are absent; None when none is any good."""
    found = sorted(_readings(lines, pictures), key=_preference)
    if not found or found[0].roughness > ROUGH:
        return None
    best = found[0]
    others = [r.roughness for r in found[1:] if (r.rises or not best.rises) and not _is_twin(r, best)]
    return StripeReading(**{**vars(best), "rival": min(others, default=1.0)})


def numbers_of(lines: Lines, pictures: Sequence[int | None], reading: StripeReading) -> NDArray[np.int32]:
    """The numbers that a reading gives along the lines, (lines, length)."""
    digits = _digits(lines, pictures, reading.inverse)
    assert digits is not None
    ordered = digits if reading.first == "most" else digits[::-1]
    spec = Stripes(code=reading.code, bits=reading.bits, base_bit=reading.base_bit)
    return number_of(spec, _word(lines, ordered, reading.inverse_first))


def _is_twin(one: StripeReading, other: StripeReading) -> bool:
    """Whether two readings of binary code differ in nothing but direction, so that no picture tells which."""
    if not one.code == other.code == "binary":
        return False
    return (one.first, one.inverse) == (other.first, other.inverse)


def _word(lines: Lines, digits: Sequence[NDArray[np.bool_]], inverse_first: bool) -> NDArray[np.int32]:
    word = np.zeros(lines.lit.shape, np.int32)
    for digit in digits:
        word = word << 1 | (digit != inverse_first)
    return word


def _preference(reading: StripeReading) -> tuple[float, bool, bool]:
    # Nearly equal ones: rising before falling, patterns before inverses.
    likely = not reading.rises, reading.inverse_first
    # Binary code that falls is that of its inverses rising: turned cameras are commoner than inverses first.
    first, second = likely[::-1] if reading.code == "binary" else likely
    return round(reading.roughness / (2 * FLOOR)), first, second


def _readings(lines: Lines, pictures: Sequence[int | None]) -> Iterator[StripeReading]:
    arrangements: list[Inverse] = [a for a in ("interleaved", "after") if _is_inverse(lines, pictures, a)]
    for inverse in arrangements or ["none"]:
        digits = _digits(lines, pictures, inverse)
        if digits is None or not FEWEST_BITS <= len(digits) <= MOST_BITS:
            continue
        for first in ("most", "least"):
            ordered = digits if first == "most" else digits[::-1]
            if _is_even(lines, ordered[-1]):
                continue
            for inverse_first in (False, True):
                word = _word(lines, ordered, inverse_first)
                for code, base in _CODES:
                    if base >= len(digits) or (code == "xor" and len(digits) < FEWEST_BITS + 1):
                        continue
                    spec = Stripes(code=code, bits=len(digits), base_bit=base)
                    yield _judged(lines, spec, number_of(spec, word), first, inverse, inverse_first)


def _is_even(lines: Lines, digit: NDArray[np.bool_]) -> bool:
    """Whether a digit is the same everywhere: the finest cannot be, but white with black looks like that."""
    seen = digit[lines.lit]
    return seen.size > 0 and not EVEN < float(seen.mean()) < 1 - EVEN


def _judged(
    lines: Lines,
    spec: Stripes,
    number: NDArray[np.int32],
    first: Literal["most", "least"],
    inverse: Inverse,
    inverse_first: bool,
) -> StripeReading:
    rough, rises = [], 0.0
    for digits in range(1, spec.bits + 1):
        # Coarse numbers first: only the finest suffer from blur.
        step = np.sign(np.diff(number >> (spec.bits - digits), axis=-1)[lines.pairs])
        # Steps count by their sign: the edge of a thing is one step, however far it jumps.
        path, way = float(np.abs(step).sum()), float(step.sum())
        if path:
            rough.append(1 - abs(way) / path)
            rises += way / path
    # A digit that never changes tells nothing, but one at least must.
    roughness = float(np.mean(rough)) if rough else 1.0
    seen = number[lines.lit]
    low, high = np.percentile(seen, (1, 99)) if seen.size else (0, 0)
    return StripeReading(
        spec.code, spec.base_bit, spec.bits, first, inverse, inverse_first, roughness, 1.0,
        (int(low), int(high)), rises >= 0,
    )  # fmt: skip


def pairs_of(pictures: Sequence[int | None], inverse: Inverse) -> list[tuple[int | None, int | None]]:
    """The two pictures of each digit, in their order, where inverses follow as ``inverse`` says."""
    half = len(pictures) // 2
    if inverse == "interleaved":
        return list(zip(pictures[0 : 2 * half : 2], pictures[1::2], strict=True))
    return list(zip(pictures[:half], pictures[half : 2 * half], strict=True))


def _is_inverse(lines: Lines, pictures: Sequence[int | None], inverse: Inverse) -> bool:
    """Whether pictures and what would be their inverses go against each other."""
    if len(pictures) % 2 or not pictures:
        return False
    against = total = 0.0
    for one, other in pairs_of(pictures, inverse):
        if one is None or other is None:
            continue
        a, b = lines.of(one) - 0.5, lines.of(other) - 0.5
        against += float(np.mean(a * b))
        total += float(np.mean(a * a) + np.mean(b * b)) / 2
    return total > 0 and against / total < COMPLEMENT


def _is_repeated(lines: Lines, pictures: Sequence[int]) -> bool:
    """Whether one picture shows the same as another, or its inverse: no two digits of a number do."""
    values = lines.some(pictures).astype(np.float64)
    varied = values[values.var(axis=1) > LEAST_VARIANCE]
    if len(varied) < 2:
        return False
    alike = np.abs(np.corrcoef(varied))
    return bool((alike - np.eye(len(varied)) > REPEATED).any())


def _digits(lines: Lines, pictures: Sequence[int | None], inverse: Inverse) -> list[NDArray[np.bool_]] | None:
    """For each digit where its picture is bright, (lines, length); None when one cannot be told."""
    if inverse == "none":
        present = [p for p in pictures if p is not None]
        if len(present) < len(pictures) or _is_repeated(lines, present):
            return None
        return [lines.values[p] > 0.5 for p in present]
    found = []
    for one, other in pairs_of(pictures, inverse):
        if one is not None and other is not None:
            found.append(lines.values[one] > lines.values[other])
        elif one is not None:
            found.append(lines.values[one] > 0.5)
        elif other is not None:
            found.append(lines.values[other] < 0.5)
        else:
            return None
    return found
