"""Memory that is used for one band after another: the system has to clear whatever else it hands out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class Room:
    """An array of each type, as large as was ever needed."""

    def __init__(self) -> None:
        self._kept: dict[np.dtype[np.generic], NDArray[Any]] = {}

    def of(self, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """An array of a shape, with any content; earlier ones of its type must not be used any more."""
        kind, count = np.dtype(dtype), math.prod(shape)
        kept = self._kept.get(kind)
        if kept is None or kept.size < count:
            # The old one is let go before the new one is made.
            self._kept.pop(kind, None)
            del kept
            kept = self._kept[kind] = np.empty(count, kind)
        return kept[:count].reshape(shape)

    def clear(self) -> None:
        """Give all memory back."""
        self._kept.clear()
