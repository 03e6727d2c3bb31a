"""Words of digits and their numbers: there and back, and neighbours that differ in a single digit."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.patterns.digits import gray_number, gray_word, with_base

BITS = 11
NUMBERS = np.arange(2**BITS, dtype=np.int32)


def test_gray_codes_of_neighbours_differ_in_one_digit() -> None:
    change = gray_word(NUMBERS)[1:] ^ gray_word(NUMBERS)[:-1]
    assert all(int(each).bit_count() == 1 for each in change)


@pytest.mark.parametrize("bits", range(1, BITS + 1))
def test_a_number_comes_back_from_its_gray_code(bits: int) -> None:
    numbers = NUMBERS[: 2**bits]
    np.testing.assert_array_equal(gray_number(gray_word(numbers), bits), numbers)


@pytest.mark.parametrize("base_bit", [0, 1, BITS - 1])
def test_every_digit_but_the_base_is_combined_with_it(base_bit: int) -> None:
    words = with_base(NUMBERS, BITS, base_bit)
    base = NUMBERS >> base_bit & 1
    np.testing.assert_array_equal(words >> base_bit & 1, base)
    for bit in set(range(BITS)) - {base_bit}:
        np.testing.assert_array_equal(words >> bit & 1, (NUMBERS >> bit & 1) ^ base)
    np.testing.assert_array_equal(with_base(words, BITS, base_bit), NUMBERS)
