"""What the Results page asks of its controllers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.state import Limits, Seek, View
from dsl_app.shared.spectrum import Pixel
from dsl_core.io.spectra.reference_file import Reference


class MarkCommands(Protocol):
    """Pins, regions and references."""

    def pin(self, pixel: Pixel) -> None:
        """Keep the spectrum of a pixel."""

    def add_outline(self, outline_px: Iterable[tuple[float, float]]) -> None:
        """Make a region of an outline."""

    def add_pixels(self, mask: NDArray[np.bool_]) -> None:
        """Make a region of a mask."""

    def add_reference(self, path: Path) -> None:
        """Take a spectrum to compare with."""

    def take_references(self, path: Path, chosen: Iterable[Reference]) -> None:
        """Take some of a file's spectra; none gives the choice up."""

    def remove(self, key: int) -> None:
        """Take a mark away."""

    def rename(self, key: int, name: str) -> None:
        """Name a mark."""

    def show(self, key: int, shown: bool) -> None:
        """Show or hide a mark."""

    def has_shown(self) -> bool:
        """Whether a spectrum is shown; says what to do where none is."""

    def copy_spectra(self, put: Callable[[str], object]) -> None:
        """Hand over the spectra that are shown, as text."""

    def export_spectra(self, path: Path, overwrite: bool) -> None:
        """Write the spectra that are shown."""


class ResultCommands(Protocol):
    """The result as a whole."""

    @property
    def marks(self) -> MarkCommands:
        """What was marked on it."""

    def open(self, path: Path) -> bool:
        """Open a result, scan or reference."""

    @property
    def is_reading(self) -> bool:
        """Whether what was opened last is still being read."""

    def reconstruct(self) -> None:
        """Make the result of the scan that is offered."""

    def command_line(self) -> str:
        """The command that does the same."""

    def show(self, view: View) -> None:
        """Look in another way."""

    def step_band(self, steps: int) -> None:
        """Go some bands up or down."""

    def move_cursor(self, dx: int, dy: int) -> None:
        """Move the cursor by pixels."""

    def point_at(self, pixel: Pixel | None) -> None:
        """Put the cursor on a pixel."""

    def limit_depth(self, limits: Limits | None) -> None:
        """Show only what lies between two depths, or all of it."""

    def relight(self, light: str, adapted: bool) -> None:
        """Show the colours under another light."""

    def search(self, seek: Seek) -> None:
        """Look for a spectrum."""

    def seek(self, what: Seek) -> None:
        """Look for the other thing."""

    def limit_search(self, within_rad: float, within_delta_e: float) -> None:
        """Change the limits of the search."""

    def end_search(self) -> None:
        """Show the image without the search."""

    def inspect(self) -> None:
        """Show what the pixel under the cursor saw line by line."""

    def export(self, targets: dict[str, Path], overwrite: bool) -> None:
        """Write formats to paths."""

    def taken(self, targets: dict[str, Path]) -> list[Path]:
        """Files that an export would replace."""
