"""What the series of the Compare page asks for."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

from dsl_app.compare.series.state import Kind
from dsl_core.evaluation.flat_target import Region
from dsl_core.evaluation.time_sweep import SweepFigure


class SeriesCommands(Protocol):
    """What the panel of a series and its parts ask of their controller."""

    def knows(self, path: Path) -> bool:
        """Whether a path is a result, or a folder with some."""

    def add(self, paths: Iterable[Path]) -> None:
        """Take results, or all results of folders."""

    def remove(self, path: Path) -> None:
        """Take a result out of the series."""

    def set_position(self, path: Path, position_mm: float) -> None:
        """Say where the stage stood."""

    def select(self, path: Path | None) -> None:
        """Look at a row."""

    def ask(self, kind: Kind) -> None:
        """Ask for depth over positions, or for accuracy over time."""

    def show_figure(self, figure: SweepFigure) -> None:
        """Show an error over seconds."""

    def compare_with(self, path: Path | None) -> None:
        """Compare with a result, or with the truth."""

    def set_region(self, region: Region | None) -> None:
        """Count only a part of the picture."""

    def write_report(self, target: Path) -> None:
        """Write the series as a page."""

    def command_line(self) -> str:
        """The command that does the same."""
