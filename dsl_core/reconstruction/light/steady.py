"""Frames as they would be in steady light, from what a scan says of the light of each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import LineStack


@dataclass(frozen=True)
class SteadyLight:
    """Logarithms of the light of each line frame and of white, and how sure those of lines are.

    ``log`` and ``std`` (frames,) are those of line frames, ``white`` that of the white one.
    """

    log: NDArray[np.float64]
    std: NDArray[np.float64]
    white: float

    def steady(self, stack: LineStack) -> None:
        """Take the course of the light off line frames, which are changed where they are."""
        for pattern, (log, std) in enumerate(zip(self.log, self.std, strict=True)):
            stack.radiance[pattern] /= np.float32(np.exp(log))
            deviation = stack.std[pattern].astype(np.float32) / np.float32(np.exp(log))
            stack.std[pattern] = np.hypot(deviation, np.float32(std) * stack.radiance[pattern])

    def steady_white(self, white: MergedFrame) -> MergedFrame:
        """White in steady light."""
        factor = np.float32(np.exp(-self.white))
        return replace(white, radiance=white.radiance * factor, variance=white.variance * factor**2)
