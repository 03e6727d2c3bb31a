"""Numbered stripes of other programs: Gray, binary or XOR digits, with or without inverse.

A digit with an inverse is the sign of a difference, as in `dsl_core.patterns.gray_code`. One without is
compared with half of white above black, after Moreno and Taubin: "Simple, accurate, and robust
projector-camera calibration", 3DIMPVT 2012, section 3.1; stripes blurred over each other then fail sooner.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.captured_code import Stripes
from dsl_core.patterns.reading import AxisReading, Measured

Numbers = NDArray[np.int32]


def stripe_levels(spec: Stripes, count: int, index: int) -> NDArray[np.float64]:
    """Frame ``index`` (of those that exist) over ``count`` columns or rows, 0 or 1, shape (count,)."""
    bit, is_inverse = [(b, inverse) for b in range(spec.bits) for inverse in spec.frames_of(b)][index]
    number = (np.arange(count) // spec.unit_px + spec.offset).astype(np.int32)
    digit = _word(spec, number) >> (spec.bits - 1 - bit) & 1
    return np.asarray(digit != is_inverse, np.float64)


def read_stripes(spec: Stripes, count: int, frames: Iterator[Measured], white: Measured) -> AxisReading:
    """Positions on an axis of ``count`` px from the frames of a set, taken one by one, and white.

    All frames are above black. The deviation of a position is that of a stripe, ``unit_px / sqrt(12)``, and
    what the weakest digit would move it by, times the probability that noise has turned that digit round.
    """
    shape = white[0].shape
    word, weakest = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    margin, sigmas = np.full(shape, np.inf, np.float32), np.full(shape, np.inf, np.float32)
    for bit in range(spec.bits):
        difference, variance = _difference([(i, next(frames)) for i in spec.frames_of(bit)], white)
        word = word << 1 | (difference > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(difference) / np.sqrt(variance)
        weaker = ~(ratio >= sigmas)
        weakest[weaker] = spec.bits - 1 - bit
        np.minimum(margin, np.abs(difference), out=margin)
        np.minimum(sigmas, ratio, out=sigmas)
    number = number_of(spec, word)
    jump = np.abs(number_of(spec, word ^ (1 << weakest)) - number).astype(np.float32)
    undecided = ~(margin > 0)
    # Of two neighbours either is right to a stripe, so that nothing is lost.
    undecided &= jump > 1
    stripe = number - spec.offset
    undecided |= (stripe < 0) | (stripe * spec.unit_px >= count)
    risk = _chance_of_turning(sigmas) * jump**2
    std = spec.unit_px * np.sqrt(1 / 12 + risk)
    position = (stripe * spec.unit_px + (spec.unit_px - 1) / 2).clip(0, count - 1)
    return AxisReading(position.astype(np.float32), std.astype(np.float32), margin, sigmas, undecided)


def _difference(frames: list[tuple[bool, Measured]], white: Measured) -> Measured:
    """What is above zero where a digit is one, and its variance."""
    if len(frames) == 2:
        (_, (one, one_variance)), (_, (other, other_variance)) = frames
        return one - other, one_variance + other_variance
    is_inverse, (value, variance) = frames[0]
    above = np.asarray(value - white[0] / 2, np.float32)
    return (-above if is_inverse else above), np.asarray(variance + white[1] / 4, np.float32)


def _chance_of_turning(sigmas: NDArray[np.float32]) -> NDArray[np.float32]:
    """Probability that noise exceeds so many deviations on one side."""
    from scipy.special import erfc

    with np.errstate(invalid="ignore"):
        return np.asarray(0.5 * erfc(np.nan_to_num(sigmas, nan=0.0) / np.sqrt(2)), np.float32)


def _word(spec: Stripes, number: Numbers) -> Numbers:
    """The digits that show a number."""
    if spec.code == "binary":
        return number
    word = number ^ (number >> 1)
    return word if spec.code == "gray" else _with_base(spec, word)


def number_of(spec: Stripes, word: Numbers) -> Numbers:
    """The numbers that words of digits mean, whole numbers of any shape."""
    if spec.code == "binary":
        return word
    number = word if spec.code == "gray" else _with_base(spec, word)
    shift = 1
    while shift < spec.bits:
        number = number ^ (number >> shift)
        shift *= 2
    return number


def _with_base(spec: Stripes, word: Numbers) -> Numbers:
    """All digits but the base combined with it; twice gives the same again."""
    others = (1 << spec.bits) - 1 - (1 << spec.base_bit)
    return np.asarray(word ^ ((word >> spec.base_bit & 1) * np.int32(others)), np.int32)
