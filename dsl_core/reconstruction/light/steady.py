"""Frames as they would be in steady light, from what a scan says of the light of each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import LineStack

#: The least that is left of a deviation when the part of the light is taken off it.
LEAST_LEFT = 0.05


@dataclass(frozen=True)
class SteadyLight:
    """Logarithms of the light of each line frame and of white, and how sure those of lines are.

    ``log`` and ``std`` (frames,) are those of line frames, ``white`` that of the white one. ``flickers`` is
    whether frames differ from their neighbours.
    """

    log: NDArray[np.float64]
    std: NDArray[np.float64]
    white: float
    flickers: bool = False

    def refined(self, log: NDArray[np.float64], std: NDArray[np.float64]) -> SteadyLight:
        """The same light after one has learned by how much more line frames differ, and how sure that is."""
        return replace(self, log=self.log + log, std=std)

    def steady(self, stack: LineStack, before: SteadyLight | None = None) -> None:
        """Take the course of the light off line frames, which are changed where they are.

        ``before`` is the course that was taken off them already.
        """
        log, std = self.log, self.std**2
        if before is not None:
            log, std = log - before.log, std - before.std**2
        for pattern, (own, more) in enumerate(zip(log, std, strict=True)):
            stack.radiance[pattern] /= np.float32(np.exp(own))
            deviation = stack.std[pattern].astype(np.float32) / np.float32(np.exp(own))
            variance = deviation**2 + np.float32(more) * stack.radiance[pattern] ** 2
            stack.std[pattern] = np.sqrt(np.maximum(variance, (LEAST_LEFT * deviation) ** 2))

    def steady_white(self, white: MergedFrame) -> MergedFrame:
        """White in steady light."""
        factor = np.float32(np.exp(-self.white))
        return replace(white, radiance=white.radiance * factor, variance=white.variance * factor**2)
