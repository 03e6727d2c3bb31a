"""Pictures of a calibration board under a code of columns, or of columns and rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import BayerPattern


@dataclass(frozen=True)
class PoseFrames:
    """Pictures of one board pose, mono or mosaic, all of one shape.

    ``pairs`` holds pattern, inverse, pattern, inverse ... in the order of the Gray code (columns before rows
    if there are any, most significant bit first). For any other code it is empty, and ``places_px`` has what
    each pixel decoded to: columns, then rows if there are any, and their deviations, px, each (axes, rows,
    columns), NaN where undecided. ``name`` is what errors call the pose. ``variance`` is that of ``white``,
    up to a factor, and ``saturated`` marks pixels without a value; pictures merged from several settings have
    both; for others they follow from the brightness.
    """

    name: str
    pairs: Sequence[NDArray[Any]]
    white: NDArray[Any]
    black: NDArray[Any]
    bayer: BayerPattern | None = None
    variance: NDArray[np.floating] | None = None
    saturated: NDArray[np.bool_] | None = None
    places_px: NDArray[np.floating] | None = None
    places_std_px: NDArray[np.floating] | None = None
