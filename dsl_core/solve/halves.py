"""Numbers of half precision for compiled loops, which know none: their bits are looked up."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray


@lru_cache(maxsize=1)
def squares_of_halves() -> NDArray[np.float32]:
    """The square of every number of half precision, by its bits, (65536,)."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.arange(65536, dtype=np.uint16).view(np.float16).astype(np.float32) ** 2
