"""What was open and how it was shown: enough to restore it after a crash. No Qt."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from dsl_core.model.plan import CapturePlan
from dsl_core.words import counted


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class ResultsPart(_Part):
    """The open result and its views; pins, regions and references are saved next to the result."""

    path: Path
    view: str = ""
    cloud_by: str = ""
    quality: str = ""
    band: int = 0
    light: str = "D65"
    adapted: bool = True
    cursor: tuple[int, int] | None = None
    depth_limits: tuple[float, float] | None = None


class ScanPart(_Part):
    """The planned scan, or the one that was running."""

    plan: CapturePlan
    target: Path
    then_reconstruct: bool = True
    meters: bool = True
    calibration: str = ""


class ComparePart(_Part):
    """The two sides; ``with_truth`` says that B was the twin's truth of A."""

    first: Path | None = None
    second: Path | None = None
    with_truth: bool = False


class SeriesPart(_Part):
    """The results of a series, the stage's position for each, and what is compared."""

    rows: tuple[tuple[Path, float | None], ...]
    kind: str = ""
    figure: str = ""
    against: Path | None = None
    region: tuple[int, int, int, int] | None = None


class Session(_Part):
    """Everything that is restored; parts are None where a page showed nothing."""

    schema_version: Literal[1] = 1
    page: str = "rig"
    results: ResultsPart | None = None
    scan: ScanPart | None = None
    compare: ComparePart | None = None
    series: SeriesPart | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """What it holds, as a person would name it; empty when there is nothing to restore."""
        found = []
        if self.results is not None:
            found.append(self.results.path.name)
        if self.scan is not None:
            found.append(f"the plan of {self.scan.target.name}")
        if self.compare is not None:
            sides = [side.name for side in (self.compare.first, self.compare.second) if side is not None]
            if sides:
                found.append(f"the comparison of {' and '.join(sides)}")
        if self.series is not None:
            found.append(f"a series of {counted(len(self.series.rows), 'result')}")
        return tuple(found)

    @property
    def is_a_plan(self) -> bool:
        """Whether it holds a scan or the plan of one and nothing else."""
        return self.scan is not None and not (self.results or self.compare or self.series)

    @property
    def offer(self) -> str:
        """The sentence that offers to restore it."""
        return f"The program did not end normally last time. These were open: {', '.join(self.names)}."
