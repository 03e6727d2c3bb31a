"""Whether light and picture were as they are now when the first pictures of a scan were taken.

Two pairs of a code that break each other's sum are taken again together, since nobody knows which of them was
wrong. That they agree then proves little: a lamp that failed for good between them leaves both dark, and a
picture that was displaced meanwhile is so in both.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import (
    ALIKE,
    BROKEN_SHARE,
    FEWEST_BROKEN,
    LEAST_BROKEN,
    LIT_SIGMAS,
    SAME_LIGHT,
    Pair,
)
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Floats, Raster

#: Light of a pair of pictures relative to the last ones from which on it is worth taking it again.
SETTLED = 0.02
#: Light of a lamp that warms up, or is switched, is on one side of its median, then on the other; it may come
#: back. With more turns than this it flickers.
MOST_TURNS = 2
#: So many pairs of one light, other than that of all later ones, were no lamp that warms up.
FEWEST_STEADY = 2
#: Pixels that have to be lit to compare the light of two pictures.
FEWEST_LIT = 60
#: Of the pictures taken again, so many others with other light than before are no single wrong picture.
FEWEST_CHANGED = 2
#: Mean light of a picture, as a share of that of all, from which on it says how strong the light is.
LEAST_LIGHT = 0.03
#: Deviation of a picture's light, as a share of its mean, from which on it has bright and dark parts.
STRUCTURED = 0.3
#: With less light than one in so many, or as much more, a picture was missing or of another scene.
MOST_CHANGE = 5.0
#: A picture shows light if its pixels differ from those of the inverse pattern by so many deviations ...
SEEN_SIGMAS = 5.0
#: ... and so many of them do, as a share of all, or so many blocks of them to either side.
SEEN_SHARE, SEEN_BLOCKS = 0.001, 0.01
_OF_THE_LAST = " times that of the last ones"


def changed_light(
    before: Mapping[int, Counts], now: Mapping[int, Counts], noise: Noise, channels: NDArray[np.int8]
) -> float | None:
    """By what factor the light of several pictures has changed, the median; None if it has not.

    ``before`` and ``now`` are pictures by the number of their pattern, of which the lowest two were taken
    first. Pictures that show another pattern than before say nothing of the light. Of colours that have
    changed unlike, as those of a display that turns warmer, the one that did most counts; ``channels`` has
    that of every pixel.
    """
    level = np.float32(noise.sensor.black_level_dn)
    bright, lit = _lit([*before.values(), *now.values()], noise)
    if int(lit.sum()) < FEWEST_LIT:
        return None
    enough = LEAST_LIGHT * float((bright[lit] - level).mean())
    ratios, first = [], sorted(before)[:2]
    for pattern, old in before.items():
        one, other = (picture[lit].astype(np.float32) - level for picture in (old, now[pattern]))
        if float(one.mean()) < enough:
            continue
        ratio, is_same_pattern = _factor(one, other, channels[lit])
        if is_same_pattern and not SAME_LIGHT[0] < ratio < SAME_LIGHT[1]:
            ratios.append(ratio)
        elif pattern in first:
            return None  # the light is what it was when the scan began
    if len(ratios) < FEWEST_CHANGED or min(ratios) < 1 < max(ratios):
        return None
    return float(np.median(ratios))


def light_of_first(
    before: Mapping[int, Counts], now: Mapping[int, Counts], noise: Noise, channels: NDArray[np.int8]
) -> float:
    """Light of the very first picture over that of the same pattern ``now``; 1 where it is alike or untold.

    Arguments are those of `changed_light`. Light that changed just after the first picture is that of all
    others, and of it itself once it was taken again.
    """
    first = min(before)
    level = np.float32(noise.sensor.black_level_dn)
    _, lit = _lit([before[first], now[first]], noise)
    if int(lit.sum()) < FEWEST_LIT:
        return 1.0
    old, new = (picture[first][lit].astype(np.float32) - level for picture in (before, now))
    ratio, is_same_pattern = _factor(new, old, channels[lit])
    is_missing = not 1 / MOST_CHANGE < ratio < MOST_CHANGE
    return 1.0 if not is_same_pattern or is_missing or SAME_LIGHT[0] < ratio < SAME_LIGHT[1] else ratio


def light_of_pairs(
    pairs: Mapping[int, tuple[Counts, Counts]],
    ends: tuple[Counts, Counts],
    lit: NDArray[np.bool_],
    noise: Noise,
) -> dict[int, float]:
    """Light of each pair over that of the ``ends``, white and black; empty where few pixels are ``lit``."""
    if int(lit.sum()) < FEWEST_LIT:
        return {}

    def light(pair: tuple[Counts, Counts]) -> float:
        return sum(float(each[lit].sum(dtype=np.float64)) for each in pair) - dark

    dark = 2 * noise.sensor.black_level_dn * float(lit.sum())
    usual = light(ends)
    return {number: light(pair) / usual for number, pair in pairs.items()}


def flickers(ratios: Mapping[int, float]) -> bool:
    """Whether light goes up and down from pair to pair; ``ratios`` are those of `light_of_pairs`."""
    if not ratios:
        return False
    light = np.array([ratios[number] for number in sorted(ratios)])
    apart = light / np.median(light) - 1
    sides = np.sign(apart[np.abs(apart) > SETTLED / 2])
    return bool(np.abs(apart).max() > SETTLED) and int(np.count_nonzero(np.diff(sides))) > MOST_TURNS


def unsettled_pairs(ratios: Mapping[int, float]) -> dict[int, float]:
    """Pairs whose light was not yet that of white and black, with the factor they have of it.

    ``ratios`` are those of `light_of_pairs`. None where the last pair differs as well: nothing has settled
    then, or it is white and black that are wrong. None of light that `flickers`, which it will do again. Of
    light that changed at once only the pair that saw both: taken again, the others would hide that nobody
    knows which light was as calibrated. Pairs beside those that differ are taken again with them.
    """
    found = {number: ratio for number, ratio in ratios.items() if abs(ratio - 1) > SETTLED}
    if not found or flickers(ratios):
        return {}
    in_order = sorted(ratios)
    alike = [abs(ratios[number] - ratios[in_order[0]]) < SETTLED / 2 for number in in_order]
    steady = alike.index(False) if False in alike else len(alike)
    if in_order[0] in found and steady >= FEWEST_STEADY and not found.keys() & set(in_order[steady + 1 :]):
        return {number: found[number] for number in in_order[steady : steady + 1] if number in found}
    if max(ratios) in found:
        return {}
    # What changed the light may have begun, or ended, in the pair beside, too little to be told.
    beside = {number + side for number in found for side in (-1, 1)} & ratios.keys()
    return {number: ratios[number] for number in sorted(found.keys() | beside)}


def unsettled_words(ratio: float) -> str:
    """What is noted of a picture that is taken again because its light was not yet that of later ones."""
    return f"{ratio:.2f}{_OF_THE_LAST}"


def light_of_words(why: str) -> float | None:
    """The light in the note of such a picture; None in any other note."""
    found = re.search(rf"(\d+\.\d+){_OF_THE_LAST}", why)
    return None if found is None else float(found[1])


def _lit(pictures: Sequence[Counts], noise: Noise) -> tuple[Counts, NDArray[np.bool_]]:
    """The brightest of each pixel, and which pixels are lit in one of the pictures and saturate in none."""
    bright = np.maximum.reduce(pictures)
    light = bright.astype(np.float32) - np.float32(noise.sensor.black_level_dn)
    is_lit = light > LIT_SIGMAS * np.sqrt(noise.variance(bright))
    return bright, is_lit & (bright < noise.sensor.full_scale_dn)


def _factor(one: Floats, other: Floats, channels: NDArray[np.int8]) -> tuple[float, bool]:
    """The factor from one picture to another in the colour where it is most, and whether both are alike."""
    parts = [channels == colour for colour in np.unique(channels)]
    parts = [own for own in parts if int(own.sum()) >= FEWEST_LIT and float(one[own].mean()) > 0]
    found = [(*_scaled(one[own], other[own]), float(one[own].mean())) for own in parts]
    found = found or [(*_scaled(one, other), float(one.mean()))]
    # An inverse is its pattern times -1.
    is_alike = all(ratio > -ALIKE and left < ALIKE * max(ratio, 1.0) * mean for ratio, left, mean in found)
    # The most by its logarithm; light that went out altogether counts as a thousandth.
    return max((ratio for ratio, *_ in found), key=lambda ratio: abs(np.log(max(ratio, 1e-3)))), is_alike


def _scaled(one: Floats, other: Floats) -> tuple[float, float]:
    """The factor from one picture to another, and the mean difference that it leaves.

    A gain that changes takes the black level with it, which shows where a pattern has bright and dark parts.
    """
    if one.std() > STRUCTURED * one.mean():
        one, other = one - one.mean(), other - other.mean()
    ratio = float(one @ other / (one @ one))
    return ratio, float(np.abs(other - ratio * one).mean())


def has_moved(before: Pair, now: Pair, noise: Noise) -> bool:
    """Whether a pattern and its inverse, taken once more, are displaced: some pixels changed sides, not most.

    Where the sum of both changed, one of them was wrong; where all of both did, they were exchanged.
    """
    every = [*before, *now]
    dark, bright = np.minimum.reduce(every), np.maximum.reduce(every)
    contrast = bright.astype(np.float32) - dark.astype(np.float32)
    sigma = np.sqrt(noise.variance(dark) + noise.variance(bright))
    lit = (contrast > LIT_SIGMAS * sigma) & (bright < noise.sensor.full_scale_dn)
    limit = BROKEN_SHARE * contrast
    one, other = (new.astype(np.float32) - old for new, old in zip(now, before, strict=True))
    changed = lit & (np.abs(one) > limit) & (np.abs(other) > limit)
    broken = lit & (np.abs(one + other) > limit)
    few = max(FEWEST_BROKEN, LEAST_BROKEN * int(lit.sum()))
    return int(broken.sum()) < few and FEWEST_BROKEN <= int((changed & ~broken).sum()) < int(lit.sum()) / 2


def is_unlit(one: Counts, other: Counts, noise: Noise, raster: Raster) -> bool:
    """Whether nothing shows a pattern nor its inverse, of which every point in the beam sees one."""
    apart = one.astype(np.float32) - other.astype(np.float32)
    variance = noise.variance(one) + noise.variance(other)
    if float((np.abs(apart) > SEEN_SIGMAS * np.sqrt(variance)).mean()) >= SEEN_SHARE:
        return False
    # Faint stripes show in means of blocks, brighter here and darker there; light that flickers does not.
    blocks = raster.pool(apart) / np.sqrt(raster.pool(variance) / raster.pooled)
    return min(float((side * blocks > SEEN_SIGMAS).mean()) for side in (-1, 1)) < SEEN_BLOCKS
