"""Numbered stripes of other programs: Gray, binary or XOR digits, with or without inverse.

A digit with an inverse is the sign of a difference, as in `dsl_core.patterns.gray_code`. One without is
compared with half of white above black, the usual threshold; stripes blurred over each other then fail
sooner.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.captured_code import Stripes
from dsl_core.patterns.digits import Numbers, gray_number, gray_word, with_base
from dsl_core.patterns.reading import AxisReading, Floats, Measured

#: Share of the pixels that see bright and dark stripes of the finest digit at once, about, and the least.
MIXED, LEAST_MIXED = 0.5, 0.01
#: In these, light that is half of white may still be a bright or dark stripe's, give or take this share of
#: the range: surfaces change within a pixel, and projectors sharpen edges or spill light over them.
UNSURE_HALF = 0.05


def stripe_levels(spec: Stripes, count: int, index: int) -> NDArray[np.float64]:
    """Frame ``index`` (of those that exist) over ``count`` columns or rows, 0 or 1, shape (count,)."""
    bit, is_inverse = [(b, inverse) for b in range(spec.bits) for inverse in spec.frames_of(b)][index]
    number = (np.arange(count) // spec.unit_px + spec.offset).astype(np.int32)
    digit = _word(spec, number) >> (spec.bits - 1 - bit) & 1
    return np.asarray(digit != is_inverse, np.float64)


def read_stripes(spec: Stripes, count: int, frames: Iterator[Measured], white: Measured) -> AxisReading:
    """Positions on an axis of ``count`` px from the frames of a set, taken one by one, and white.

    All frames are above black. The deviation of a position is that of a stripe, ``unit_px / sqrt(12)``, and
    what each digit would move it by, times the probability that noise, or a surface that changes within
    the pixel, has turned that digit round.
    """
    shape = white[0].shape
    word, weakest = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    margin, sigmas = np.full(shape, np.inf, np.float32), np.full(shape, np.inf, np.float32)
    # Half precision is enough for what a digit says of itself, and no picture of many digits is small.
    chances = list[NDArray[np.float16]]()
    for bit in range(spec.bits):
        seen = [(i, next(frames)) for i in spec.frames_of(bit)]
        difference, variance = _difference(seen, white)
        word = word << 1 | (difference > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(difference) / np.sqrt(variance)
        weaker = ~(ratio >= sigmas)
        weakest[weaker] = spec.bits - 1 - bit
        np.minimum(margin, np.abs(difference), out=margin)
        np.minimum(sigmas, ratio, out=sigmas)
        most = white[0] * np.float32(1 if len(seen) == 2 else 0.5)
        chances.append(_chance_of_turning(difference, variance, most, _mixed(spec, bit)))
    number = number_of(spec, word)
    jump = _jump(spec, word, number, 1 << weakest)
    undecided = ~(margin > 0)
    # Of two neighbours either is right to a stripe, so that nothing is lost.
    undecided &= jump > 1
    stripe = number - spec.offset
    undecided |= (stripe < 0) | (stripe * spec.unit_px >= count)
    risk = np.zeros(shape, np.float32)
    for bit, chance in enumerate(chances):
        risk += chance.astype(np.float32) * _jump(spec, word, number, 1 << (spec.bits - 1 - bit)) ** 2
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


def _jump(spec: Stripes, word: Numbers, number: Numbers, digit: Numbers | int) -> Floats:
    """By how many stripes a number changes where a digit is turned round."""
    return np.asarray(np.abs(number_of(spec, np.asarray(word ^ digit)) - number), np.float32)


def _mixed(spec: Stripes, bit: int) -> float:
    """Share of the pixels that are at an edge of a digit's stripes: it has half as many as the next."""
    return MIXED if spec.code == "xor" else max(MIXED / 2 ** (spec.bits - 1 - bit), LEAST_MIXED)


def _chance_of_turning(
    difference: Floats, variance: Floats, most: Floats, mixed: float
) -> NDArray[np.float16]:
    """Probability that a digit is the other one, where differences are from minus to plus ``most``.

    Bayes' rule, for pixels that see one stripe or, a share ``mixed`` of them, any mixture of both.
    """
    from scipy.special import ndtr

    with np.errstate(divide="ignore", invalid="ignore", under="ignore"):
        away = np.abs(difference) / most
        noise = np.sqrt(variance) / most
        right, wrong = (np.exp(-0.5 * ((away + side) / noise) ** 2) / noise for side in (-1, 1))
        any_share = mixed / (1 - mixed) * np.sqrt(2 * np.pi)
        turned = wrong + any_share * ndtr(-away / np.hypot(noise, 2 * UNSURE_HALF))
        chance = turned / (right + wrong + any_share)
    return np.asarray(np.nan_to_num(chance, nan=0.5).clip(0, 0.5), np.float16)


def _word(spec: Stripes, number: Numbers) -> Numbers:
    """The digits that show a number."""
    if spec.code == "binary":
        return number
    word = gray_word(number)
    return word if spec.code == "gray" else with_base(word, spec.bits, spec.base_bit)


def number_of(spec: Stripes, word: Numbers) -> Numbers:
    """The numbers that words of digits mean, whole numbers of any shape."""
    if spec.code == "binary":
        return word
    gray = word if spec.code == "gray" else with_base(word, spec.bits, spec.base_bit)
    return gray_number(gray, spec.bits)
