"""Patterns that other programs project: stripes with or without inverse, and shifted sinusoids."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from dsl_core.model.base import Record

#: More digits than any projector has columns, and more steps than anybody takes.
MOST_BITS, MOST_STEPS, MOST_SETS = 16, 64, 16
Axis = Literal["columns", "rows"]


class Stripes(Record):
    """Digits of numbered stripes, the most significant first, each followed by its inverse if there is one.

    A stripe of one number is ``unit_px`` wide; the first column or row has the number ``offset``. An XOR code
    projects the digit ``base_bit`` (0: the finest) as it is and all others combined with it. ``lacking`` are
    frames that were never captured, counted from 0 in this order; the digit's other frame stands for them.
    """

    kind: Literal["stripes"] = "stripes"
    code: Literal["gray", "binary", "xor"] = "gray"
    bits: int = Field(ge=1, le=MOST_BITS)
    inverse: bool = True
    unit_px: int = Field(default=1, ge=1)
    offset: int = Field(default=0, ge=0)
    base_bit: int = Field(default=0, ge=0)
    lacking: tuple[int, ...] = ()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.code == "xor" and self.base_bit >= self.bits:
            raise ValueError(f"base_bit {self.base_bit} does not exist among {self.bits} bits")
        if any(not 0 <= index < self.digit_frames * self.bits for index in self.lacking):
            raise ValueError(f"lacking must name frames 0 to {self.digit_frames * self.bits - 1}")
        for bit in range(self.bits):
            if not self.frames_of(bit):
                raise ValueError(
                    f"nothing is left of bit {bit} (0: the most significant); give its picture, or fewer bits"
                    " with a larger unit_px where the finest is missing"
                )
        return self

    @property
    def digit_frames(self) -> int:
        """Frames of a digit when none is lacking."""
        return 2 if self.inverse else 1

    def frames_of(self, bit: int) -> tuple[bool, ...]:
        """For each frame of a digit (0: the most significant) that exists, whether it is the inverse."""
        first = bit * self.digit_frames
        return tuple(bool(k) for k in range(self.digit_frames) if first + k not in self.lacking)

    @property
    def frame_count(self) -> int:
        """Frames that exist."""
        return self.digit_frames * self.bits - len(set(self.lacking))


class Phases(Record):
    """Sinusoids of several periods, each shifted by equal steps over one period.

    Frame ``k`` of a period ``p`` is ``0.5 + 0.5 cos(2 pi x / p + start + direction 2 pi k / steps)`` at
    column or row ``x``; all steps of the first period come first.
    """

    kind: Literal["phases"] = "phases"
    periods_px: tuple[float, ...] = Field(min_length=1, max_length=MOST_SETS)
    steps: int = Field(ge=3, le=MOST_STEPS)
    start_deg: float = 0.0
    direction: Literal[1, -1] = 1

    @model_validator(mode="after")
    def _check(self) -> Self:
        if any(period < 2 for period in self.periods_px):
            raise ValueError("a period needs at least 2 px")
        return self

    @property
    def frame_count(self) -> int:
        """Frames of all periods."""
        return self.steps * len(self.periods_px)


PatternSet = Annotated[Stripes | Phases, Field(discriminator="kind")]


class CapturedCode(Record):
    """What a folder of another program holds: sets that code columns, then sets that code rows.

    The sets of an axis tell one position together: stripes say in which period of a sinusoid it is.
    """

    kind: Literal["captured"] = "captured"
    column_sets: tuple[PatternSet, ...] = Field(default=(), max_length=MOST_SETS)
    row_sets: tuple[PatternSet, ...] = Field(default=(), max_length=MOST_SETS)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not (self.column_sets or self.row_sets):
            raise ValueError("neither columns nor rows are coded")
        return self

    @property
    def rows(self) -> bool:
        """Whether rows are coded."""
        return bool(self.row_sets)

    @property
    def frame_count(self) -> int:
        """Frames of all sets, without white and black."""
        return sum(each.frame_count for each in (*self.column_sets, *self.row_sets))
