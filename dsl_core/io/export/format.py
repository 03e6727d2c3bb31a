"""What a format for other programs says of itself; a package of one's own can add some."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr


class Exporter(Protocol):
    """What every format offers; some take more keywords, all of them optional here."""

    def __call__(
        self, result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never
    ) -> list[Path]:
        """Write the result and return the files written; raises `StoreError`, and what ``check`` raises."""


@dataclass(frozen=True)
class Format:
    """A format by its ``key``, such as ply: what the window says ``about`` it, and what writes it.

    ``suffix`` is the ending of its file, with the dot; ``endings`` are others that mean it too. Some need
    the result to have spectra, or pixels that were chosen. What is not ``listed`` is asked for by name alone.
    """

    key: str
    suffix: str
    about: str
    write: Exporter
    needs_spectra: bool = False
    needs_pins: bool = False
    endings: tuple[str, ...] = ()
    listed: bool = True
