"""Where a reconstruction puts its result, some rows at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.result import build_result

if TYPE_CHECKING:
    import xarray as xr

Maps = Mapping[str, NDArray[np.generic]]
#: Is given the maps of a result by the names of `VARIABLES`, all but the spectra, before these are computed.
SeenGeometry = Callable[[Maps], object]


class ResultSink(Protocol):
    """Takes the rows of a result in any order; ``note`` is a little text that belongs to some rows."""

    def begin(
        self,
        shape: tuple[int, int],
        origin: tuple[int, int],
        wavelengths_nm: NDArray[np.float64],
        bands: Sequence[slice],
    ) -> None:
        """Expect the rows of a picture of a shape, in ``bands``.

        ``origin`` is its first row and column in the camera's picture.
        """

    def note_of(self, rows: slice) -> str | None:
        """The note of rows that are kept already, from an earlier run that was stopped; None for others."""

    def put(self, rows: slice, maps: Maps, note: str) -> None:
        """Keep the maps (..., rows, columns) of some rows."""

    def finish(self, attributes: dict[str, str | int | float]) -> xr.Dataset:
        """The whole result."""


class MemorySink:
    """Keeps a result in memory."""

    def begin(
        self,
        shape: tuple[int, int],
        origin: tuple[int, int],
        wavelengths_nm: NDArray[np.float64],
        bands: Sequence[slice],
    ) -> None:
        """Expect the rows of a picture of a shape, in ``bands``.

        ``origin`` is its first row and column in the camera's picture.
        """
        self._shape, self._origin, self._nm = shape, origin, wavelengths_nm
        self._maps: dict[str, NDArray[np.generic]] = {}

    def note_of(self, rows: slice) -> None:
        """Nothing is kept from earlier."""

    def put(self, rows: slice, maps: Maps, note: str) -> None:
        """Keep the maps of some rows; those of a whole picture are kept as they are."""
        if rows.stop - rows.start == self._shape[0]:
            self._maps = dict(maps)
            return
        for name, part in maps.items():
            if name not in self._maps:
                self._maps[name] = np.empty((*part.shape[:-2], *self._shape), part.dtype)
            self._maps[name][..., rows, :] = part

    def finish(self, attributes: dict[str, str | int | float]) -> xr.Dataset:
        """The whole result."""
        return build_result(self._maps, self._nm, attributes, self._origin)
