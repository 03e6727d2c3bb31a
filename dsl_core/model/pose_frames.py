"""Pictures of a calibration board under Gray code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from dsl_core.model.rig import BayerPattern


@dataclass(frozen=True)
class PoseFrames:
    """Pictures of one board pose, mono or mosaic, all of one shape.

    ``pairs`` holds pattern, inverse, pattern, inverse ... in the order of the Gray code (columns before rows,
    most significant bit first). ``name`` is what errors call the pose.
    """

    name: str
    pairs: Sequence[NDArray[Any]]
    white: NDArray[Any]
    black: NDArray[Any]
    bayer: BayerPattern | None = None
