"""Whether the light stayed the same while lines passed over a flat target, as its zero order shows.

Through a filter nothing else tells: there is no code, and no picture that comes twice. From one line to the
next the zero order of an even target changes little, whatever the angle does to the filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.normal import MEDIAN_OVER_MEAN_STD, STD_OF_MEDIAN_SIZE

Floats = NDArray[np.float64]

#: Parts that the columns are split into, pixels that each of them needs, and parts that a fit needs.
PARTS, FEWEST, FEWEST_PARTS = 24, 6, 10
#: A change at once that is one, as a share and in deviations.
JUMP, SIGMAS = 0.05, 6.0
#: Share of the usual light that counts as none.
GONE = 0.02
#: Orders of the polynomial that is a smooth course of the light's logarithm, the next where what one leaves
#: with a step is this many times what parts are off by (variances). A filter at the edge of an LED's light is
#: seen at its own angle by every pixel, and passes several times as much on one side as on the other.
COURSES, WELL = (2, 4), 2.0
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
            std = STD_OF_MEDIAN_SIZE * (high - low) / 2
            variance.append((MEDIAN_OVER_MEAN_STD * std) ** 2 / own.size)
    if len(at) < FEWEST_PARTS:
        return None
    place = 2 * (np.array(at) + 0.5) / PARTS - 1
    level = float(np.median(mean))
    if not level > 0:
        # A filter that lets nothing through.
        return None
    seen = np.maximum(mean, GONE * level)
    value, std = np.log(seen), np.sqrt(np.array(variance) / seen**2 + UNEVEN**2)
    for order in COURSES:
        found = max(_step(place, value, std, k, order) for k in range(2, len(at) - 1))
        if found.left < WELL:
            break
    share = float(np.expm1(found.height))
    if found.gain <= 0 or abs(share) < JUMP or abs(found.height) < SIGMAS * found.height_std:
        return None
    return LightJump(share, at[found.part] * frame_px / PARTS)


class _Step(NamedTuple):
    """What a step explains (chi-square), its height and deviation, its part, and chi-square left per part."""

    gain: float
    height: float
    height_std: float
    part: int
    left: float


def _step(place: Floats, value: Floats, std: Floats, k: int, order: int) -> _Step:
    """A step before part ``k`` of a course that is a polynomial of an ``order`` otherwise."""
    course = np.vander(place, order + 1, increasing=True)
    design, wanted = np.column_stack([course, place >= place[k]]) / std[:, None], value / std
    without, *_ = np.linalg.lstsq(design[:, :-1], wanted, rcond=None)
    terms, *_ = np.linalg.lstsq(design, wanted, rcond=None)
    smooth_left = float(((wanted - design[:, :-1] @ without) ** 2).sum())
    left = float(((wanted - design @ terms) ** 2).sum())
    # Where the course is not smooth either, a step is less sure.
    each = left / max(len(place) - design.shape[1], 1)
    height_std = float(np.sqrt(max(each, 1.0) * np.linalg.pinv(design.T @ design)[-1, -1]))
    return _Step(smooth_left - left, float(terms[-1]), height_std, k, each)
