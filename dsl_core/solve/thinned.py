"""A part of many pixels, spread over all of them."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", bound=np.generic)


def thinned(values: NDArray[T], about: int) -> NDArray[T]:
    """Every n-th of ``values`` (count,), n odd: at most twice ``about``, all where there are fewer.

    Pixels of a picture are numbered along its rows. An even step would see every other column alone, and
    with it only two of the four sites of a colour mosaic.
    """
    return values[:: len(values) // about | 1]
