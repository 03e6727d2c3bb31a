"""Pictures of a calibration board under Gray code."""

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

    ``pairs`` holds pattern, inverse, pattern, inverse ... in the order of the Gray code (columns before rows,
    most significant bit first). ``name`` is what errors call the pose. ``variance`` is that of ``white``, up
    to a factor, and ``saturated`` marks pixels without a value; pictures merged from several settings have
    both; for others they follow from the brightness.
    """

    name: str
    pairs: Sequence[NDArray[Any]]
    white: NDArray[Any]
    black: NDArray[Any]
    bayer: BayerPattern | None = None
    variance: NDArray[np.floating] | None = None
    saturated: NDArray[np.bool_] | None = None
