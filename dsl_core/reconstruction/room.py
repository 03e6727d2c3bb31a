"""Memory that is used for one band after another: the system has to clear whatever else it hands out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class Room:
    """An array for each use, as large as was ever needed."""

    def __init__(self) -> None:
        self._kept: dict[str, NDArray[Any]] = {}

    def of(self, use: str, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """An array of a shape, with any content; earlier ones of this use must not be used any more."""
        kind, count = np.dtype(dtype), math.prod(shape)
        kept = self._kept.get(use)
        if kept is None or kept.size < count or kept.dtype != kind:
            # The old one is let go before the new one is made.
            self._kept.pop(use, None)
            del kept
            kept = self._kept[use] = np.empty(count, kind)
        return kept[:count].reshape(shape)

    def clear(self) -> None:
        """Give all memory back."""
        self._kept.clear()
