"""What one axis of a code says of each pixel: a position on the projector, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]
#: A frame above black and its variance, in one unit and its square, arrays of one shape.
Measured = tuple[Floats, Floats]


@dataclass(frozen=True)
class AxisReading:
    """Positions of pixels on an axis of the projector, arrays of one shape.

    ``position_px`` counts from the middle of the first column or row and ``std_px`` is its deviation, which
    holds what a wrong digit or period would do; ``margin`` (in the unit of the frames) and ``margin_sigmas``
    say how far the weakest decision was from its opposite. ``undecided`` pixels keep the better guess.
    """

    position_px: Floats
    std_px: Floats
    margin: Floats
    margin_sigmas: Floats
    undecided: Bools
