"""A few full lines of every picture, relative to the darkest and the brightest value of each pixel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]
Decode = Callable[[Floats], Floats]
#: Lines that are looked at in each direction.
LINES = 16
#: Pixels that are enough to know a distribution.
SOME = 1000
#: A pixel is lit when its range reaches this share of the range of bright pixels.
LIT_SHARE = 0.25
#: Percentiles of the ranges of pixels that are those of bright ones: usually, and where an object is small.
BRIGHT, BRIGHT_OF_FEW = 90, 99.5
#: What only noise changes has no larger range, in standard deviations of the noise.
MOST_NOISE = 7.0
#: Of `_noise`: a percentile that edges of stripes hardly reach, and what it is of normal noise.
QUIET, QUIET_SIGMAS = 75, 1.15 * 6**0.5


@dataclass(frozen=True)
class Lines:
    """Values along lines, (pictures, lines, length), 0 the darkest of a pixel, 1 the brightest; ``lit`` ones.

    Lines run along the direction in which positions on the projector are to be told apart.
    """

    values: Floats
    lit: Bools

    @property
    def pairs(self) -> Bools:
        """Neighbours along the lines that are both lit, (lines, length - 1)."""
        return np.asarray(self.lit[:, 1:] & self.lit[:, :-1])

    def steps(self, picture: int) -> float:
        """Mean change from neighbour to neighbour of one picture; 0 where nothing is lit."""
        pairs = self.pairs
        if not pairs.any():
            return 0.0
        return float(np.abs(np.diff(self.values[picture], axis=-1))[pairs].mean())

    def some(self, pictures: Sequence[int]) -> Floats:
        """Values of some lit pixels, (pictures, pixels)."""
        return np.asarray(self._some[np.asarray(pictures)])

    @cached_property
    def _some(self) -> Floats:
        lit = np.flatnonzero(self.lit)
        chosen = lit[:: lit.size // SOME | 1]  # an odd step keeps all colours of a mosaic
        return np.asarray(self.values.reshape(len(self.values), -1)[:, chosen])

    def of(self, picture: int) -> Floats:
        """Values of the lit pixels of one picture."""
        return np.asarray(self.values[picture][self.lit])


@dataclass(frozen=True)
class Probes:
    """Lines across (along rows of the picture) and down; ``range_share`` is how much light comes and goes."""

    across: Lines
    down: Lines
    range_share: float


class ProbeTaker:
    """Keeps lines of pictures that are shown to it one by one."""

    def __init__(self) -> None:
        self._across: list[Floats] = []
        self._down: list[Floats] = []

    def add(self, grey: NDArray[np.number]) -> None:
        """Look at a picture (rows, columns); all must have one size."""
        rows, columns = (_places(length) for length in grey.shape)
        self._across.append(np.asarray(grey[rows], np.float32))
        self._down.append(np.asarray(grey[:, columns].T, np.float32))

    def finish(self, full_scale: float, decode: Decode | None = None) -> Probes:
        """The lines of all pictures, which reach up to ``full_scale``; ``decode`` makes 0..1 linear light."""
        across, span = _relative(_decoded(self._across, full_scale, decode))
        down, _ = _relative(_decoded(self._down, full_scale, decode))
        return Probes(across, down, span if decode else span / full_scale)


def _decoded(pictures: list[Floats], full_scale: float, decode: Decode | None) -> list[Floats]:
    return pictures if decode is None else [decode(lines / np.float32(full_scale)) for lines in pictures]


def _places(length: int) -> NDArray[np.intp]:
    """Lines spread over a picture, away from its edges."""
    count = min(LINES, length)
    return np.unique(((np.arange(count) + 0.5) / count * length).astype(np.intp))


def _relative(pictures: Sequence[Floats]) -> tuple[Lines, float]:
    values = np.stack(pictures)
    low, high = values.min(0), values.max(0)
    span = high - low
    bright, most = np.percentile(span, (BRIGHT, BRIGHT_OF_FEW)).tolist()
    noise = MOST_NOISE * _noise(values)
    if bright < noise < most:
        bright = most
    lit = span > max(LIT_SHARE * bright, min(noise, bright / 2), 1e-9)
    values -= low
    values /= np.maximum(span, 1e-9)
    return Lines(values, lit), bright


def _noise(values: Floats) -> float:
    """Standard deviation of noise along lines (pictures, lines, length), by the picture that varies least.

    0 of lines that are too short to tell.
    """
    if values.shape[-1] < 5:
        return 0.0
    # Every second pixel of a line has one colour of a mosaic.
    bends = np.abs(values[..., 4:] - 2 * values[..., 2:-2] + values[..., :-4]).reshape(len(values), -1)
    return float(np.percentile(bends, QUIET, axis=1).min()) / QUIET_SIGMAS
