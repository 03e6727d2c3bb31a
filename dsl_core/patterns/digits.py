"""Numbers of stripes as words of binary digits, and back: Gray code, and XOR code made of it.

A word of the Gray code is ``n xor (n >> 1)`` of its number n (F. Gray, US patent 2,632,058, 1953). The XOR
code combines all digits of that word but one, the base, with this one (Gupta et al., CVPR 2011).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.int32]


def gray_word(number: Numbers) -> Numbers:
    """The Gray code of numbers, same shape.

    >>> gray_word(np.arange(4, dtype=np.int32)).tolist()
    [0, 1, 3, 2]
    """
    return number ^ (number >> 1)


def gray_number(word: Numbers, bits: int) -> Numbers:
    """The numbers whose Gray code these words of so many ``bits`` are, same shape."""
    # A digit of the number is the exclusive or of all digits of the word down to it.
    number, shift = word, 1
    while shift < bits:
        number = number ^ (number >> shift)
        shift *= 2
    return number


def with_base(word: Numbers, bits: int, base_bit: int) -> Numbers:
    """All digits but ``base_bit`` (0: the finest) combined with it; twice gives the same words again."""
    others = (1 << bits) - 1 - (1 << base_bit)
    return np.asarray(word ^ ((word >> base_bit & 1) * np.int32(others)), np.int32)
