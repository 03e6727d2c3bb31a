"""A stack of frames of which only some pixels are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class PickedCube:
    """Values (frames, n) of ``pixels`` (n,), rising flat indices, of a picture of a ``width``.

    It is read as a cube (frames, rows, columns) is with three arrays of indices.
    """

    values: NDArray[np.floating]
    pixels: NDArray[np.intp]
    width: int

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.values)

    def __getitem__(
        self, at: tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]
    ) -> NDArray[np.floating]:
        """The values at frames, rows and columns, which are broadcast against each other."""
        frame, row, column = at
        flat = row * self.width + column
        place = np.searchsorted(self.pixels, flat)
        if not np.array_equal(self.pixels[np.minimum(place, len(self.pixels) - 1)], flat):
            raise IndexError("this pixel was not picked")
        return np.asarray(self.values[frame, place])
