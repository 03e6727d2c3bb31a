"""Light of a projected point against the distance, as samples: four shapes, wider blur, wider in corners.

Nothing here integrates a profile in closed form, as the solver does: densities are sampled and summed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.simulation.foreign.variants import Foreign

Floats = NDArray[np.float64]
#: Samples a projector pixel: light between two is shared out, which widens a spread of 0.6 px by 0.1 %.
FINE = 16
#: True blur over stated blur; widest over usual spread in the corners.
BLUR_RATIO, CORNER_RATIO = 1.08, 1.4
#: Share of the light in the tails, and how much wider these are.
TAIL_SHARE, TAIL_RATIO = 1 / 8, 3.0
#: Share of the variance of the softened box that is the box's; standard deviations of the two sides.
BOX_SHARE, SKEW_SIDES = 0.9, (0.6, 1.4)
#: Widths between usual and widest at which a spread that varies is sampled.
WIDTHS = 5
#: Reach of a spread, in its own standard deviations.
REACH = 4.5


def gaussian(x: Floats, std: float) -> Floats:
    """The usual spread at distances (px)."""
    return np.asarray(np.exp(-0.5 * (x / max(std, 1e-6)) ** 2))


def square(x: Floats, std: float) -> Floats:
    """A box, softened by a Gaussian that has the rest of the variance."""
    half = 0.5 * std * math.sqrt(12 * BOX_SHARE)
    soft = std * math.sqrt(1 - BOX_SHARE)
    places = np.linspace(-half, half, 401)
    return np.asarray(gaussian(x[:, None] - places, soft).mean(1))


def skewed(x: Floats, std: float) -> Floats:
    """Two half Gaussians of different widths about one top, moved and scaled to mean 0 and the variance."""
    low, high = SKEW_SIDES
    mean = (high - low) * math.sqrt(2 / math.pi)
    variance = (1 - 2 / math.pi) * (high - low) ** 2 + low * high
    u = x / std * math.sqrt(variance) + mean
    return np.asarray(np.exp(-0.5 * (u / np.where(u < 0, low, high)) ** 2))


@dataclass(frozen=True)
class Spread:
    """The line spread of a projector whose calibration says ``blur_px``."""

    blur_px: float
    foreign: Foreign

    @property
    def widths(self) -> tuple[float, ...]:
        """Relative widths that occur, rising; one where the spread is the same everywhere."""
        if not self.foreign.has("spread-corners"):
            return (1.0,)
        return tuple(float(w) for w in np.linspace(1.0, CORNER_RATIO, WIDTHS))

    @property
    def reach(self) -> int:
        """Samples on each side of the middle that hold a lit pixel's light, in multiples of `FINE`."""
        tails = TAIL_RATIO if self.foreign.has("spread-tails") else 1.0
        widest = self.blur_px * BLUR_RATIO * tails * self.widths[-1]
        return FINE * math.ceil(0.5 + REACH * widest)

    def point(self, width: float = 1.0) -> Floats:
        """Light of a point at samples ``-reach`` to ``reach``, `FINE` a pixel, of sum 1."""
        x = np.arange(-self.reach, self.reach + 1) / FINE
        std = self.blur_px * width * (BLUR_RATIO if self.foreign.has("blur") else 1.0)
        if not self.foreign.has("spread-tails"):
            return self._core(x, std)
        return (1 - TAIL_SHARE) * self._core(x, std) + TAIL_SHARE * self._core(x, TAIL_RATIO * std)

    def _core(self, x: Floats, std: float) -> Floats:
        """The spread without tails; equal parts of two shapes where both were asked for."""
        shapes = [
            shape
            for name, shape in (("spread-square", square), ("spread-skew", skewed))
            if self.foreign.has(name)
        ]
        parts = [shape(x, std) for shape in shapes or [gaussian]]
        return np.asarray(sum(part / part.sum() for part in parts) / len(parts))

    def pixel(self, width: float = 1.0) -> Floats:
        """Light of a lit pixel, one wide, at the same samples: 1 inside wide bands of lit pixels."""
        return _pixel(self, width)

    def width_at(self, columns_px: Floats, rows_px: Floats, size_px: tuple[int, int]) -> Floats:
        """Relative width at places of a frame of a size (width, height): square law up to the corners."""
        w, h = size_px
        x, y = (columns_px - (w - 1) / 2) / (w / 2), (rows_px - (h - 1) / 2) / (h / 2)
        return np.asarray(1 + (CORNER_RATIO - 1) * np.clip((x**2 + y**2) / 2, 0, 1))


@lru_cache(maxsize=64)
def _pixel(spread: Spread, width: float) -> Floats:
    """See `Spread.pixel`: asked for over and over again."""
    box = np.ones(FINE + 1)
    box[[0, -1]] = 0.5
    light = np.convolve(spread.point(width), box, "same")
    light.setflags(write=False)
    return light
