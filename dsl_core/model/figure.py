"""A measured figure with its limits: the result of a check."""

from __future__ import annotations

import math

from dsl_core.model.base import Record

#: No figure has more decimals.
MOST_DECIMALS = 9


class Figure(Record):
    """A value with unit, uncertainty and limits; ``advice`` says what to do when it is outside them.

    ``std`` is one standard deviation, None for counts. A limit of None does not exist. A figure without
    limits only informs.
    """

    name: str
    value: float
    unit: str
    std: float | None = None
    low: float | None = None
    high: float | None = None
    advice: str = ""

    @property
    def passed(self) -> bool:
        """Whether the value is within its limits."""
        return self._passes(self.value)

    def _passes(self, value: float) -> bool:
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)

    @property
    def limits(self) -> str:
        """The limits with their unit as people write them, empty where there are none.

        >>> Figure(name="gamma", value=2.2, unit="1", low=1.8, high=2.6).limits
        '1.8 to 2.6'
        >>> Figure(name="camera error", value=0.01, unit="px", high=0.5).limits
        'at most 0.5 px'
        >>> Figure(name="stale frames", value=0, unit="", high=0).limits
        'none allowed'
        """
        match self.low, self.high:
            case None, None:
                return ""
            case None, 0.0:
                return "none allowed"
            case None, high:
                return f"at most {high:.4g}{self._unit}"
            case low, None:
                return f"at least {low:.4g}{self._unit}"
            case low, high:
                return f"{low:.4g} to {high:.4g}{self._unit}"

    def __str__(self) -> str:
        """The figure as people write it, such as ``gamma 2.210 ± 0.004``.

        It has two digits of its deviation, but none far below its limits; without a deviation three digits.
        More are written only where it would seem to be on the other side of a limit.

        >>> print(Figure(name="camera error", value=0.0123456, unit="px", high=0.5))
        camera error 0.012 px
        >>> print(Figure(name="camera error", value=0.50004, unit="px", high=0.5))
        camera error 0.50004 px
        """
        digits = 0 if self.std is None and float(self.value).is_integer() else self._decimals
        while digits < MOST_DECIMALS and self._passes(round(self.value, digits)) is not self.passed:
            digits += 1
        return f"{self.name} {_spread(self.value, self.std, digits)}{self._unit}"

    @property
    def _unit(self) -> str:
        return "" if self.unit in ("", "1") else f" {self.unit}"

    @property
    def _decimals(self) -> int:
        """Decimals by the deviation or the value, but none far below what limits can tell apart."""
        own = decimals(self.std) if self.std else decimals(self.value, 3)
        told = self._span or self.low or self.high
        if not told:
            return own
        judged = decimals(told, 4 if self.std else 3)
        # Narrow limits are judged by the digits in which they differ.
        return judged if self._span and not self.std else min(own, judged)

    @property
    def _span(self) -> float:
        """How far apart two limits are; 0 for a single one."""
        return 0.0 if self.low is None or self.high is None else max(self.high - self.low, 0.0)


def with_std(value: float, std: float | None, most: int = MOST_DECIMALS) -> str:
    """A value and its deviation with two digits of the deviation, of ``most`` decimals; else three digits.

    A deviation that is not finite is one that nobody knows.

    >>> with_std(210.8184, 0.0204), with_std(3.0, 0.0), with_std(0.0123456, None), with_std(2.0, 1e-6, 4)
    ('210.818 ± 0.020', '3', '0.0123', '2.0000 ± 0.0001')
    >>> with_std(70.151, float("nan"))
    '70.2 ± unknown'
    """
    if std and math.isfinite(std):
        return _spread(value, std, min(decimals(std), most))
    alone = f"{value:.0f}" if float(value).is_integer() else _spread(value, None, decimals(value, 3))
    return f"{alone} ± unknown" if std else alone


def in_places(value: float, std: float | None, form: str) -> tuple[str, str]:
    """A value and its deviation in words, to as many places as two digits of the deviation need.

    ``form``, such as ``+.3f``, says the fewest places of both. The deviation is empty where there is none.
    """
    if std is None:
        return format(value, form), ""
    if not math.isfinite(std):
        return format(value, form), "unknown"
    if std > 0:
        sign, fewest = form.removesuffix("f").split(".")
        needed = min(1 - math.floor(math.log10(std)), 8)
        form = f"{sign}.{max(int(fewest), needed)}f"
    return format(value, form), format(std, form.removeprefix("+"))


def with_std_in_places(value: float, std: float | None, form: str) -> str:
    """A value with its deviation as `in_places` words them; the value alone where there is none."""
    shown, spread = in_places(value, std, form)
    return f"{shown} ± {spread}" if spread else shown


def decimals(value: float, digits: int = 2) -> int:
    """Decimals that show so many ``digits`` of a value.

    >>> decimals(0.0204), decimals(0.0123456, 3), decimals(210.8, 3), decimals(0.0), decimals(99.96, 3)
    (3, 4, 0, 0, 1)
    """
    if value == 0 or not math.isfinite(value):
        return 0
    return min(max(digits - 1 - math.floor(math.log10(abs(value))), 0), MOST_DECIMALS)


def _spread(value: float, std: float | None, digits: int) -> str:
    # A deviation below the last digit is told as one of that digit, as it is no zero.
    spread = f" ± {max(std, 10.0**-digits):.{digits}f}" if std else ""
    # Adding zero makes -0.0 a plain zero.
    return f"{round(value, digits) + 0.0:.{digits}f}{spread}"


def doubts(name: str, sentences: tuple[str, ...], between: str = ". ") -> Figure:
    """How many doubts there are, of which there should be none; the advice is what they say."""
    return Figure(name=name, value=float(len(sentences)), unit="", high=0.0, advice=between.join(sentences))


def failures(figures: tuple[Figure, ...]) -> tuple[Figure, ...]:
    """The figures outside their limits."""
    return tuple(figure for figure in figures if not figure.passed)
