"""Several results together: a flat target at stage positions, or scans of one scene by capture time."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from dsl_app.shared.evented import Value
from dsl_app.shared.replaced import Stamp
from dsl_core.evaluation.seen_target import Region, SeenTarget
from dsl_core.evaluation.stage_test import StageTest
from dsl_core.evaluation.time_sweep import FIGURES, SweepFigure, SweepPoint


class SeriesKind(Enum):
    """What a series measures."""

    STAGE = "Depth over stage positions"
    SWEEP = "Accuracy over time"


#: What an empty series says.
NOTHING = {
    SeriesKind.STAGE: (
        "Add results of one flat target at three or more stage positions: choose a folder that contains"
        " them, or drop them here. Positions are read from names such as “stage 695.2 mm.zarr”, or typed"
        " into the table."
    ),
    SeriesKind.SWEEP: (
        "Add results of one scene scanned with different plans: choose a folder that contains them, or drop"
        " them here. They are compared with the ground truth of the simulated rig, or with one of the"
        " results."
    ),
}


# Targets are arrays, which have no single result of ``==``: a row equals itself alone.
@dataclass(frozen=True, eq=False)
class SeriesRow:
    """A result of the series; ``position_mm`` is None while the stage position is unknown.

    A row that has not been read has neither a target (or point) nor a trouble, which says why there is none
    or why it does not count beside the other rows. ``stamp`` is that of the result on disk when it was read.
    """

    path: Path
    position_mm: float | None = None
    target: SeenTarget | None = None
    target_trouble: str = ""
    point: SweepPoint | None = None
    point_trouble: str = ""
    stamp: Stamp = None

    @property
    def name(self) -> str:
        """The name of the result."""
        return self.path.stem

    def is_read(self, kind: SeriesKind) -> bool:
        """Whether the row has been read for a kind of series."""
        if kind is SeriesKind.STAGE:
            return self.target is not None or bool(self.target_trouble)
        return self.point is not None or bool(self.point_trouble)

    def trouble(self, kind: SeriesKind) -> str:
        """Why the result does not count; empty when it does or has not been read."""
        if kind is SeriesKind.SWEEP:
            return self.point_trouble
        lacks_position = self.target is not None and self.position_mm is None
        return self.target_trouble or ("Type the stage position." if lacks_position else "")

    def counts(self, kind: SeriesKind) -> bool:
        """Whether the result contributes to the figures."""
        return self.is_read(kind) and not self.trouble(kind)


class SeriesState:
    """Values that `SeriesController` sets and the panel follows.

    ``test`` is the depth test of the rows, ``advice`` what is missing for one. ``against`` is the result that
    a sweep compares with, None for the ground truth. ``selected`` is the path of a row, ``region`` the part
    of the picture that the target fills (None: all of it), ``busy`` what is being done (empty: nothing).
    """

    def __init__(self) -> None:
        self.kind = Value(SeriesKind.STAGE)
        self.rows: Value[tuple[SeriesRow, ...]] = Value(())
        self.test: Value[StageTest | None] = Value(None)
        self.advice = Value("")
        self.against: Value[Path | None] = Value(None)
        self.figure: Value[SweepFigure] = Value(FIGURES[0])
        self.selected: Value[Path | None] = Value(None)
        self.region: Value[Region | None] = Value(None)
        self.busy = Value("")

    @property
    def counted(self) -> tuple[SeriesRow, ...]:
        """Rows that contribute to the figures."""
        return tuple(row for row in self.rows.value if row.counts(self.kind.value))

    @property
    def reported(self) -> tuple[SeriesKind, tuple[SeriesRow, ...]]:
        """What a report would be of; another one as soon as any of its figures may be."""
        return self.kind.value, self.counted

    @property
    def points(self) -> tuple[SweepPoint, ...]:
        """Points of the sweep."""
        return tuple(row.point for row in self.rows.value if row.point is not None)

    @property
    def selected_row(self) -> SeriesRow | None:
        """The selected row."""
        return next((row for row in self.rows.value if row.path == self.selected.value), None)


@dataclass(frozen=True)
class SeriesDisplay:
    """What the panel of a series shows; ``references`` are the names and paths to compare with."""

    remark: str
    has_rows: bool
    is_stage: bool
    can_remove: bool
    can_report: bool
    references: tuple[tuple[str, Path | None], ...]


def series_display(state: SeriesState) -> SeriesDisplay:
    """What to show for a state."""
    rows, against, busy = state.rows.value, state.against.value, state.busy.value
    kind, paths = state.kind.value, [row.path for row in rows]
    # The reference stays, even when its row is removed.
    others = [] if against is None or against in paths else [against]
    remark = f"{busy}…" if busy else state.advice.value
    return SeriesDisplay(
        remark=remark if rows else NOTHING[kind],
        has_rows=bool(rows),
        is_stage=kind is SeriesKind.STAGE,
        can_remove=state.selected_row is not None,
        can_report=bool(rows) and not state.advice.value and not busy,
        references=(("Ground truth", None), *((path.stem, path) for path in (*paths, *others))),
    )
