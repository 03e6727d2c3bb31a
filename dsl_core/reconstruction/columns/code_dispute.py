"""Which of two codes is right where they disagree: the scan lines decide.

A line that lights a pixel straight makes a peak at the pixel's column, whatever arrives by other ways. So the
column of each code is refined on the lines, and the one with a peak is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import Progress
from dsl_core.reconstruction.columns.maps import ColumnFinder, ColumnMaps
from dsl_core.reconstruction.hdr import MergedFrame

#: The zero order must carry this share of the white signal; with less, only first orders reach the pixel.
ZERO_ORDER_SHARE = 0.4
#: What is enough where one of two codes points at the peak: first orders, some 150 columns wide, stay below.
DISPUTED_SHARE = 0.2
#: First orders and glare bring less than this share in any one line, by so many standard deviations.
DARK_SHARE, DARK_SIGMAS = 0.2, 3.0
#: Of two peaks the higher one counts when it is so many times the other.
CLEARLY_HIGHER = 2.0
SAME_PEAK_PX = 0.5
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Settled:
    """For all pixels (P,): where ``straight`` light is proven, and where codes ``disagree`` for good."""

    straight: Bools
    disagree: Bools


def settle(
    code: DecodedCode, maps: ColumnMaps, finder: ColumnFinder, lit: Bools, progress: Progress | None = None
) -> Settled:
    """Put the better of both answers into the maps of all pixels; ``lit`` (P,) are worth it."""
    straight = np.zeros(lit.size, bool) if code.straight is None else code.straight.ravel().copy()
    disagree = np.zeros(lit.size, bool)
    if code.rival_column is None:
        return Settled(straight, disagree)
    rival = code.rival_column.ravel()
    disputed = np.flatnonzero((rival >= 0) & lit)
    # The fine stripes of the first code may have shown that its light comes straight, however much else does.
    sound = straight[disputed]
    if finder.profiles is None:
        disagree[disputed] = ~sound
        return Settled(straight, disagree)
    first = maps.of(disputed)
    second = finder.find(disputed, rival[disputed].astype(np.float32), progress=progress)
    one = has_peak(first, disputed, finder.white, np.where(sound, 0.0, DISPUTED_SHARE))
    two = has_peak(second, disputed, finder.white, DISPUTED_SHARE)
    ratio = second.amplitude / np.maximum(first.amplitude, 1e-30)
    take = two & (~one | (ratio > CLEARLY_HIGHER))
    alike = one & two & (ratio <= CLEARLY_HIGHER) & (ratio >= 1 / CLEARLY_HIGHER)
    # Columns a little apart lead to one and the same peak.
    alike &= np.abs(second.column_px - first.column_px) > SAME_PEAK_PX
    disagree[disputed] = alike | (~one & ~two & ~sound)
    straight[disputed] |= (one | two) & ~alike
    maps.put(disputed[take], second.of(take))
    return Settled(straight, disagree)


def has_peak(
    maps: ColumnMaps,
    pixels: NDArray[np.intp] | slice,
    white: MergedFrame,
    share: float | NDArray[np.float64] = ZERO_ORDER_SHARE,
) -> Bools:
    """Whether lines refined the column of pixels with at least a share of their white light, (P,)."""
    light, saturated = white.radiance.ravel()[pixels], white.saturated.ravel()[pixels]
    return np.asarray(maps.refined & (saturated | (maps.amplitude >= share * light)))


def is_dark(maps: ColumnMaps, white: MergedFrame) -> Bools:
    """Whether lines failed to refine pixels because they surely bring hardly any of the white light, (P,)."""
    light = np.where(white.saturated.ravel(), -np.inf, white.radiance.ravel())
    return np.asarray(
        ~maps.refined & (maps.amplitude + DARK_SIGMAS * maps.amplitude_std < DARK_SHARE * light)
    )
