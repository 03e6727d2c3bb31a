"""Whether black, captured again, has become as bright as white somewhere: something was shown or lit there.

Black of the beginning was dark, so that nothing is in the picture all the time; what came in later, such as a
window or a mouse pointer, takes the contrast of its place and sheds its own light on the rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.lasting.black_light import SEEN_SIGMAS, LitBlack, lit_black
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.capture.proof.white_again import repeats
from dsl_core.model.plan import CapturePlan, Shot


@dataclass(frozen=True)
class LitAgain:
    """Where black is as bright as white by the time white was captured again as ``shot``."""

    shot: Shot
    lit: LitBlack

    @property
    def sentence(self) -> str:
        """What is wrong, since when, and what to do."""
        return (
            f"By frame {self.shot.number}, black has become as bright as white in columns"
            f" {self.lit.columns[0]}-{self.lit.columns[1]}, rows {self.lit.rows[0]}-{self.lit.rows[1]} of"
            " the picture: something came into the projected picture (a message, a window, the mouse"
            " pointer), or a lamp into view. Nothing is measured there, and its light falls on the rest."
            " Close other programs, take it away, and scan again."
        )


def lit_again(
    plan: CapturePlan, kept: Mapping[int, Counts], channels: NDArray[np.int8], noise: Noise, raster: Raster
) -> LitAgain | None:
    """The first white captured again whose black is as bright as it somewhere, and was not at first.

    ``kept`` are the rasters of shots, by index, and ``channels`` the colours of their pixels.
    """
    size_px = plan.camera_size_px
    for shot, before, now in repeats(plan, kept):
        variance = noise.variance(before[1]) + noise.variance(now[1])
        gained = now[1].astype(np.float32) - before[1] > SEEN_SIGMAS * np.sqrt(variance)
        came = np.where(gained, now[1], now[1].min())
        found = lit_black(now[0], came, channels, noise, raster, size_px)
        if found is not None and lit_black(*before, channels, noise, raster, size_px) is None:
            return LitAgain(shot, found)
    return None
