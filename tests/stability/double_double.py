"""Numbers of 106 bits as unevaluated sums of two doubles, many at once.

The error-free transformations of Dekker (*A floating-point technique for extending the available precision*,
1971) and Knuth (two-sum), and the arithmetic of Hida, Li and Bailey (*Library for double-double and
quad-double arithmetic*, 2000): relative error below 2^-102 an operation, where exponents stay moderate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Index = int | slice | tuple[int | slice, ...] | None

#: Splits a double into halves of 26 bits.
SPLITTER = 134217729.0


def two_sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """``a + b`` rounded, and exactly what the rounding lost."""
    total = a + b
    back = total - a
    return total, (a - (total - back)) + (b - back)


def two_product(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """``a * b`` rounded, and exactly what the rounding lost."""
    product = a * b
    ah, bh = a * SPLITTER, b * SPLITTER
    ah, bh = ah - (ah - a), bh - (bh - b)
    al, bl = a - ah, b - bh
    return product, ((ah * bh - product) + ah * bl + al * bh) + al * bl


@dataclass(frozen=True)
class Wide:
    """``high + low``, with ``high`` their sum rounded to double; arrays of one shape."""

    high: Floats
    low: Floats

    @classmethod
    def of(cls, values: Floats) -> Wide:
        """Doubles as they are."""
        high = np.asarray(values, np.float64)
        return cls(high, np.zeros_like(high))

    def __getitem__(self, index: Index) -> Wide:
        return Wide(self.high[index], self.low[index])

    def put(self, index: Index, other: Wide) -> None:
        """Write values into a part of these."""
        self.high[index], self.low[index] = other.high, other.low

    def __neg__(self) -> Wide:
        return Wide(-self.high, -self.low)

    def __add__(self, other: Wide) -> Wide:
        high, low = two_sum(self.high, other.high)
        more, rest = two_sum(self.low, other.low)
        high, low = two_sum(high, low + more)
        return Wide(*two_sum(high, low + rest))

    def __sub__(self, other: Wide) -> Wide:
        return self + (-other)

    def __mul__(self, other: Wide) -> Wide:
        high, low = two_product(self.high, other.high)
        return Wide(*two_sum(high, low + (self.high * other.low + self.low * other.high)))

    def __truediv__(self, other: Wide) -> Wide:
        first = self.high / other.high
        rest = self - other * Wide.of(first)
        second = rest.high / other.high
        rest = rest - other * Wide.of(second)
        return Wide(*two_sum(first, second)) + Wide.of(rest.high / other.high)

    def double(self) -> Floats:
        """Rounded to doubles."""
        return np.asarray(self.high + self.low)

    def log(self) -> Floats:
        """Natural logarithm in double: its own rounding is all that is lost."""
        return np.asarray(np.log(self.high) + self.low / self.high)
