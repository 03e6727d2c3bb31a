"""How the width of the projector's line spread changes over its frame."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from dsl_core.model.base import Record

#: Powers of column and row in the logarithm of the width, in the order of their coefficients.
POWERS = tuple((total - row, row) for total in range(5) for row in range(total + 1))


class SpreadField(Record):
    """How much wider than the usual one the line spread is, by place on the projector.

    The logarithm of the width is the sum of ``coefficients[k] * x**i * y**j`` with ``i, j = POWERS[k]``, and
    x and y are column and row from ``centre_px`` in units of ``half_px``. Beyond one unit nothing was
    measured, and the width stays as it is there.
    """

    centre_px: tuple[float, float]
    half_px: tuple[float, float]
    coefficients: tuple[float, ...] = Field(min_length=1, max_length=len(POWERS))

    @model_validator(mode="after")
    def _check(self) -> Self:
        if min(self.half_px) <= 0:
            raise ValueError(f"half_px must be above zero, given {self.half_px}")
        return self
