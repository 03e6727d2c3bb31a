"""How a live frame is shown: tone, stretch, gain and white balance. Nothing that is saved depends on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

#: Share of the pixels that a stretch makes black, and that it makes white, %.
DARKEST, BRIGHTEST = 0.5, 99.8
#: A logarithmic tone shows shares from one over this to one in equal steps of their ratio.
LOG_REACH = 1000.0
#: The most by which means of colours differ where white can be told: a picture of one colour has none.
MOST_BALANCE = 5.0
#: A stretch uses each so-manieth row and column of cells: enough for percentiles.
EACH = 4
Levels = tuple[float, float]


class Tone(Enum):
    """How counts become brightness; the value is what it is called."""

    ROOT = "Square root"
    LINEAR = "Linear"
    LOG = "Logarithmic"


@dataclass(frozen=True)
class Display:
    """How to show a frame: ``stretch`` fits black and white to it, ``balance`` makes its mean grey."""

    tone: Tone = Tone.ROOT
    stretch: bool = False
    gain: float = 1.0
    balance: bool = False


#: As frames are shown if nothing else is chosen, and as a person sees them first: black and grey as such.
PLAIN = Display()
FIRST = Display(stretch=True, balance=True)


def display_tables(
    display: Display, channels: Sequence[NDArray[np.uint16]], full_scale_dn: int
) -> tuple[NDArray[np.uint8], ...]:
    """Brightness of each count, 0 to ``full_scale_dn``, for red, green and blue: bytes (counts,).

    ``channels`` are those of the frame, (rows, columns) each. A stretch puts the same counts to black and
    white in all of them; white balance makes their means equal (grey world), saturated pixels left out,
    unless they differ by more than `MOST_BALANCE`: red light is to look red.
    """
    thin = [values[::EACH, ::EACH] for values in channels]
    low, high = _levels(thin) if display.stretch else (0.0, float(full_scale_dn))
    factors = _balance(thin, low, full_scale_dn) if display.balance else (1.0,) * len(thin)
    counts = np.arange(full_scale_dn + 1)
    share = np.maximum(counts - low, 0) / (high - low)
    return tuple(_toned(share * (display.gain * factor), display.tone) for factor in factors)


def _levels(channels: Sequence[NDArray[np.uint16]]) -> Levels:
    low = min(float(np.percentile(values, DARKEST)) for values in channels)
    high = max(float(np.percentile(values, BRIGHTEST)) for values in channels)
    # A few counts of noise are not stretched to a picture of snow.
    return low, max(high, low + 16)


def _balance(channels: Sequence[NDArray[np.uint16]], low: float, full_scale_dn: int) -> tuple[float, ...]:
    known = np.all([values < full_scale_dn for values in channels], axis=0)
    means = [max(float((values[known] - low).mean()), 1.0) if known.any() else 1.0 for values in channels]
    middle = float(np.median(means))
    if max(means) > MOST_BALANCE * min(means):
        return (1.0,) * len(means)
    return tuple(middle / mean for mean in means)


def _toned(share: NDArray[np.float64], tone: Tone) -> NDArray[np.uint8]:
    share = np.minimum(share, 1)
    if tone is Tone.ROOT:
        share = np.sqrt(share)
    elif tone is Tone.LOG:
        share = np.log1p(share * LOG_REACH) / np.log1p(LOG_REACH)
    return np.round(255 * share).astype(np.uint8)
