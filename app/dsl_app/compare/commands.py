"""What the Compare page asks for."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from dsl_app.compare.pair.state import Shown
from dsl_app.shared.spectrum import Pixel


class CompareCommands(Protocol):
    """What the page and its parts ask of their controller."""

    def open(self, path: Path) -> bool:
        """Put a result on a free side."""

    def open_side(self, path: Path, second: bool) -> None:
        """Read a result as A or B."""

    def open_both(self, first: Path, second: Path) -> None:
        """Read two results as A and B."""

    def use_truth(self) -> None:
        """Take the truth of A as B."""

    def swap(self) -> None:
        """Let A and B change places."""

    def show(self, shown: Shown) -> None:
        """Show depth or a band."""

    def set_band(self, band: int) -> None:
        """Show a common band."""

    def point_at(self, pixel: Pixel) -> None:
        """Move the cursor."""

    def write_report(self, target: Path) -> None:
        """Write the report."""

    def command_line(self) -> str:
        """The command that does the same."""
