"""Several results together: a flat target at stage positions, or scans of one scene over their seconds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from dsl_app.shared.evented import Value
from dsl_core.evaluation.flat_target import Region, SeenTarget
from dsl_core.evaluation.stage_test import StageTest
from dsl_core.evaluation.time_sweep import FIGURES, SweepFigure, SweepPoint


class Kind(Enum):
    """What a series is asked."""

    STAGE = "Depth over stage positions"
    SWEEP = "Accuracy over time"


@dataclass(frozen=True)
class Row:
    """A result of the series; ``position_mm`` is None while nobody has said where the stage stood.

    What has not been read yet has neither a target (or point) nor a trouble, which says why there is none.
    """

    path: Path
    position_mm: float | None = None
    target: SeenTarget | None = None
    target_trouble: str = ""
    point: SweepPoint | None = None
    point_trouble: str = ""

    @property
    def name(self) -> str:
        """What the result is called."""
        return self.path.stem

    def is_read(self, kind: Kind) -> bool:
        """Whether nothing is to be read for what is asked."""
        if kind is Kind.STAGE:
            return self.target is not None or bool(self.target_trouble)
        return self.point is not None or bool(self.point_trouble)

    def trouble(self, kind: Kind) -> str:
        """Why the result does not count; empty where it does, or is not read yet."""
        if kind is Kind.SWEEP:
            return self.point_trouble
        if self.target is not None and self.position_mm is None:
            return "Type the position of the stage."
        return self.target_trouble

    def counts(self, kind: Kind) -> bool:
        """Whether the result is part of the answer."""
        return self.is_read(kind) and not self.trouble(kind)


class SeriesState:
    """Values that the controller of a series sets and its panel follows.

    ``test`` is what the rows say of depth, ``advice`` what is missing for it. ``against`` is the result that
    a sweep compares with, None for the truth. ``selected`` is the path of a row, ``region`` the part of the
    picture that the target fills (None: all of it), ``busy`` what is being done (empty: nothing).
    """

    def __init__(self) -> None:
        self.kind = Value(Kind.STAGE)
        self.rows: Value[tuple[Row, ...]] = Value(())
        self.test: Value[StageTest | None] = Value(None)
        self.advice = Value("")
        self.against: Value[Path | None] = Value(None)
        self.figure: Value[SweepFigure] = Value(FIGURES[0])
        self.selected: Value[Path | None] = Value(None)
        self.region: Value[Region | None] = Value(None)
        self.busy = Value("")

    @property
    def counted(self) -> tuple[Row, ...]:
        """Rows that are part of the answer."""
        return tuple(row for row in self.rows.value if row.counts(self.kind.value))

    @property
    def points(self) -> tuple[SweepPoint, ...]:
        """Points of the sweep."""
        return tuple(row.point for row in self.rows.value if row.point is not None)

    @property
    def selected_row(self) -> Row | None:
        """The row that is looked at."""
        return next((row for row in self.rows.value if row.path == self.selected.value), None)
