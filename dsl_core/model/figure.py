"""A measured figure with its limits: the result of a check."""

from __future__ import annotations

import math

from dsl_core.model.base import Record


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
        return (self.low is None or self.value >= self.low) and (self.high is None or self.value <= self.high)

    @property
    def limits(self) -> str:
        """The limits as people write them, empty where there are none.

        >>> Figure(name="gamma", value=2.2, unit="1", low=1.8, high=2.6).limits
        '1.8 to 2.6'
        """
        match self.low, self.high:
            case None, None:
                return ""
            case None, high:
                return f"at most {high:.4g}"
            case low, None:
                return f"at least {low:.4g}"
            case low, high:
                return f"{low:.4g} to {high:.4g}"

    def __str__(self) -> str:
        """The figure as people write it, such as ``gamma 2.210 ± 0.004``."""
        counted = self.std is None and float(self.value).is_integer()
        digits = 0 if counted else _decimals(self.std if self.std else abs(self.value) / 100)
        spread = "" if self.std is None else f" ± {self.std:.{digits}f}"
        unit = "" if self.unit in ("", "1") else f" {self.unit}"
        return f"{self.name} {self.value:.{digits}f}{spread}{unit}"


def _decimals(step: float) -> int:
    """Decimals that show two digits of a step."""
    return 0 if step <= 0 else min(max(1 - math.floor(math.log10(step)), 0), 9)


def doubts(name: str, sentences: tuple[str, ...], between: str = ". ") -> Figure:
    """How many doubts there are, of which there should be none; the advice is what they say."""
    return Figure(name=name, value=float(len(sentences)), unit="", high=0.0, advice=between.join(sentences))


def failures(figures: tuple[Figure, ...]) -> tuple[Figure, ...]:
    """The figures outside their limits."""
    return tuple(figure for figure in figures if not figure.passed)
