"""What was open and how it was looked at: enough to come back to it after a crash. No Qt."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from dsl_core.model.plan import CapturePlan


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class ResultsPart(_Part):
    """The open result and its views; pins, regions and references lie beside it and are kept there."""

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
    """What would have been scanned next, or was being scanned."""

    plan: CapturePlan
    target: Path
    then_reconstruct: bool = True
    calibration: str = ""


class ComparePart(_Part):
    """The two sides; ``with_truth`` says that B was what the twin knows of A."""

    first: Path | None = None
    second: Path | None = None
    with_truth: bool = False


class SeriesPart(_Part):
    """The results of a series, where the stage stood for each, and what they were asked."""

    rows: tuple[tuple[Path, float | None], ...]
    kind: str = ""
    figure: str = ""
    against: Path | None = None
    region: tuple[int, int, int, int] | None = None


class Session(_Part):
    """All of it; parts are missing where a page held nothing."""

    schema_version: Literal[1] = 1
    page: str = "rig"
    results: ResultsPart | None = None
    scan: ScanPart | None = None
    compare: ComparePart | None = None
    series: SeriesPart | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """What it holds, as a person would name it; empty when there is nothing worth coming back to."""
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
            count = len(self.series.rows)
            found.append(f"a series of {count} result{'' if count == 1 else 's'}")
        return tuple(found)
