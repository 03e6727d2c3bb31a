"""What the grating equation leaves over: a small smooth correction of first-order columns."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from dsl_core.model.base import Record

Range = tuple[float, float]


class ColumnResidual(Record):
    """Columns (px) to add to those of the grating equation: one polynomial for each order.

    Terms are products of Chebyshev polynomials whose degrees ``degrees`` names, in camera column, camera row,
    inverse depth and wavelength, each mapped from its range to -1..1 and held constant outside it. Without
    terms the correction is zero: the grating equation was found to be enough. Orders not named have none.
    """

    orders: tuple[int, ...]
    column_range_px: Range
    row_range_px: Range
    depth_range_mm: Range
    wavelength_range_nm: Range
    degrees: tuple[tuple[int, int, int, int], ...] = ()
    coefficients_px: tuple[tuple[float, ...], ...] = Field(default=())

    @model_validator(mode="after")
    def _check(self) -> Self:
        for low, high in (
            self.column_range_px,
            self.row_range_px,
            self.depth_range_mm,
            self.wavelength_range_nm,
        ):
            if not low < high:
                raise ValueError(f"a range must rise, given {low:g} to {high:g}")
        if len(self.coefficients_px) != len(self.orders) or any(
            len(row) != len(self.degrees) for row in self.coefficients_px
        ):
            raise ValueError("a column residual needs one row of coefficients an order, one for each term")
        return self
