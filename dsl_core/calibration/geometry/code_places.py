"""Which column and row of the projector each pixel of a pose sees, as finely as its bits can be read.

A camera pixel that is as wide as the finest stripes sees as much of the lit as of the dark ones. It still
tells the coarser stripe that it sees, whose middle is its place with a larger deviation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.boards import grey_of
from dsl_core.calibration.geometry.code_model import gray_code_of
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.patterns.gray_code import bit_counts, lit_mask

Floats = NDArray[np.float64]

#: A bit counts when it differs from its inverse by this share of the light on its pixel.
MIN_MARGIN = 0.05
#: Pixels with less light than this share of the brightest ones are in shadow.
MIN_LIGHT = 0.03
#: So many of the finest bits may be unclear: stripes of 16 columns are then the finest that are read.
FINEST_UNCLEAR = 2


@dataclass(frozen=True)
class CodePlaces:
    """Places on the projector (px) and their deviations, arrays (axes, rows, columns).

    The columns, then rows if they are coded; NaN in shadow, where a coarse bit is unclear, and outside the
    projector. ``outside`` is the share of the pixels with clear bits that decode to places outside of it.
    """

    px: Floats
    std_px: Floats
    outside: float


def code_places(frames: PoseFrames, projector_size_px: tuple[int, int]) -> CodePlaces:
    """Decode the Gray code of a pose pixel by pixel, mosaic or not: a pixel is compared with itself only."""
    light = grey_of(frames.white) - grey_of(frames.black)
    lit = lit_mask(light, 0, MIN_LIGHT * float(np.quantile(light, 0.99)))
    pairs = list(zip(frames.pairs[::2], frames.pairs[1::2], strict=True))
    places, steps, beyond = [], [], np.zeros(light.shape, bool)
    for bits, size in zip(
        bit_counts(gray_code_of(frames, projector_size_px), projector_size_px), projector_size_px, strict=True
    ):
        if not bits:
            continue
        first, step = _stripes(pairs[:bits], np.where(lit, light, np.inf))
        pairs = pairs[bits:]
        beyond |= first >= size
        places.append(first + (step - 1) / 2)
        steps.append(step)
    read = np.isfinite(places).all(0)
    px = np.where(read & ~beyond, np.stack(places), np.nan)
    return CodePlaces(px, np.stack(steps) / np.sqrt(12), float((read & beyond).sum() / max(read.sum(), 1)))


def _stripes(
    pairs: list[tuple[NDArray[Any], NDArray[Any]]], light: NDArray[np.floating]
) -> tuple[Floats, Floats]:
    """First pixel and width (px) of the finest stripe that each pixel (rows, columns) tells; NaN for none."""
    index, digit = np.zeros(light.shape, np.int64), np.zeros(light.shape, bool)
    left, clear = np.full(light.shape, len(pairs)), np.ones(light.shape, bool)
    for pattern, inverse in pairs:
        difference = grey_of(pattern) - grey_of(inverse)
        clear &= np.abs(difference) >= MIN_MARGIN * light
        # A binary digit is the exclusive or of the Gray digits so far, most significant first.
        digit ^= difference > 0
        index = np.where(clear, 2 * index + digit, index)
        left -= clear
    step = 2.0**left
    return np.where(left <= FINEST_UNCLEAR, index * step, np.nan), step
