"""Whether the light stayed the same while lines passed over a flat target, as its zero order shows.

Through a filter nothing else tells: there is no code, and no picture that comes twice. From one line to the
next the zero order of an even target changes little, whatever the angle does to the filter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Parts that the columns are split into, pixels that each of them needs, and parts that a fit needs.
PARTS, FEWEST, FEWEST_PARTS = 24, 6, 10
#: A change at once that is one, as a share and in deviations.
JUMP, SIGMAS = 0.05, 6.0
#: What an even target, seen through a filter, may leave from part to part beside a smooth course, as a share.
UNEVEN = 0.005


@dataclass(frozen=True)
class LightJump:
    """By how much light changed at once, as a share, and at which column of the projector."""

    share: float
    column_px: float


def light_jump(column_px: Floats, relative: Floats, frame_px: int) -> LightJump | None:
    """The change of the zero order at once that explains it best; None if there is none.

    ``relative`` (P,) is its light over what an even target would have, of pixels of one colour that see the
    columns ``column_px`` of a frame of so many. What changes smoothly is the angle's.
    """
    part = np.clip((column_px / frame_px * PARTS).astype(int), 0, PARTS - 1)
    at, mean, variance = [], [], []
    for k in range(PARTS):
        own = relative[part == k]
        if own.size >= FEWEST:
            # Median and quartiles, since some pixels are dirty.
            low, middle, high = np.percentile(own, (25, 50, 75))
            at.append(k)
            mean.append(middle)
            variance.append((1.25 * (high - low) / 1.35) ** 2 / own.size)
    if len(at) < FEWEST_PARTS:
        return None
    place = 2 * (np.array(at) + 0.5) / PARTS - 1
    level = float(np.median(mean))
    if not level > 0:
        # A filter that lets nothing through.
        return None
    value, std = np.array(mean) / level, np.sqrt(np.array(variance) / level**2 + UNEVEN**2)
    found = [_step(place, value, std, k) for k in range(2, len(at) - 1)]
    gain, share, share_std, k = max(found)
    if gain <= 0 or abs(share) < max(JUMP, SIGMAS * share_std):
        return None
    return LightJump(share, at[k] * frame_px / PARTS)


def _step(place: Floats, value: Floats, std: Floats, k: int) -> tuple[float, float, float, int]:
    """What a step before part ``k`` explains (chi-square), its height, the deviation of that, and ``k``."""
    smooth = np.stack([np.ones_like(place), place, place**2, place >= place[k]], 1) / std[:, None]
    wanted = value / std
    without, *_ = np.linalg.lstsq(smooth[:, :3], wanted, rcond=None)
    terms, *_ = np.linalg.lstsq(smooth, wanted, rcond=None)
    smooth_left, left = (
        float(((wanted - design @ found) ** 2).sum())
        for design, found in ((smooth[:, :3], without), (smooth, terms))
    )
    # Where the course is not smooth either, a step is less sure.
    worse = max(left / max(len(place) - 4, 1), 1.0)
    height_std = float(np.sqrt(worse * np.linalg.pinv(smooth.T @ smooth)[3, 3]))
    return smooth_left - left, float(terms[3]), height_std, k
