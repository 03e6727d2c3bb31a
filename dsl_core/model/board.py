"""Printed calibration boards."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from dsl_core.model.base import Record


class Checkerboard(Record):
    """A checkerboard, counted in inner corners: where four squares meet."""

    kind: Literal["checkerboard"] = "checkerboard"
    columns: int = Field(ge=3)
    rows: int = Field(ge=3)
    square_mm: float = Field(gt=0)

    @property
    def corner_grid(self) -> tuple[int, int]:
        """Corners along the board's x and y."""
        return self.columns, self.rows


class Charuco(Record):
    """A checkerboard with a marker in every white square, counted in squares, as OpenCV does.

    ``legacy`` boards were drawn by OpenCV before 4.6 (black corner elsewhere when rows are even).
    """

    kind: Literal["charuco"] = "charuco"
    columns: int = Field(ge=4)
    rows: int = Field(ge=4)
    square_mm: float = Field(gt=0)
    marker_mm: float = Field(gt=0)
    dictionary: str = Field(default="DICT_5X5_100", pattern=r"^DICT_[A-Z0-9_]+$")
    legacy: bool = False

    @field_validator("dictionary", mode="before")
    @classmethod
    def _spelled_alike(cls, given: Any) -> Any:
        """OpenCV has some names in two spellings, as DICT_APRILTAG_36h11 and DICT_APRILTAG_36H11."""
        return given.upper() if isinstance(given, str) else given

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.marker_mm >= self.square_mm:
            raise ValueError("the markers of a ChArUco board must be smaller than its squares")
        return self

    @property
    def corner_grid(self) -> tuple[int, int]:
        """Corners along the board's x and y."""
        return self.columns - 1, self.rows - 1


Board = Annotated[Checkerboard | Charuco, Field(discriminator="kind")]


def corner_positions_mm(board: Board) -> NDArray[np.float64]:
    """Position of every corner on the board, row by row, shape (corners, 3), mm, z = 0."""
    columns, rows = board.corner_grid
    y, x = np.mgrid[:rows, :columns]
    return np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3) * float(board.square_mm)
