"""How evenly a camera sees: its relative gain over the image."""

from __future__ import annotations

from typing import Self

import numpy as np
from pydantic import model_validator

from dsl_core.model.base import Record


class FlatField(Record):
    """Relative gain of the camera (vignetting), ``gain[row][column]`` at rising rows and columns (px).

    Bilinear between these nodes and constant outside them. The white scale holds where the gain is one.
    """

    rows_px: tuple[float, ...]
    columns_px: tuple[float, ...]
    gain: tuple[tuple[float, ...], ...]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not (self.rows_px and self.columns_px):
            raise ValueError("a flat field needs at least one row and one column")
        if np.any(np.diff(self.rows_px) <= 0) or np.any(np.diff(self.columns_px) <= 0):
            raise ValueError(
                "rows and columns of a flat field must rise strictly; sort them and drop repeats"
            )
        shape = (len(self.rows_px), len(self.columns_px))
        if len(self.gain) != shape[0] or any(len(row) != shape[1] for row in self.gain):
            raise ValueError(f"a flat field on these nodes needs {shape[0]} rows of {shape[1]} gains")
        if not all(0 < value < np.inf for row in self.gain for value in row):
            raise ValueError("every gain of a flat field must be a number above zero")
        return self
