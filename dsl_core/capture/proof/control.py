"""A picture of the first code that, taken once more, shows whether devices and scene are as they were."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from dsl_core.capture.proof.code_pairs import Pair, alike
from dsl_core.capture.proof.raster import Counts, Floats, Noise

#: Stripes are well seen by a pixel, or by so many of those that are lit, with this share of the contrast.
WELL_SEEN = 0.7
#: Contrast relative to what it was that is no change.
UNCHANGED = 0.03
#: A pixel is lit with a contrast of so many deviations.
LIT_SIGMAS = 12.0
#: Edges of a pattern have moved if so many pixels changed sides, by this share of the contrast, but not most.
FEWEST_CHANGED, CHANGED, MOST_CHANGED = 8, 0.3, 0.4
#: Less contrast than this, as a share of what it was, shows no edges.
LEAST_CONTRAST = 0.3


def choose_pairs(pairs: Mapping[int, Pair], shape: tuple[int, int]) -> tuple[int, ...]:
    """The pairs with the most and the fewest stripes of those well seen; ``shape`` is that of the raster.

    Stripes rather than white: they move when anything does. The widest are not their own mirror image, as all
    others of a Gray code are.
    """
    if not pairs:
        return ()
    found: dict[int, int] = {}
    contrast = _contrast(pairs.values())
    lit = contrast > float(np.median(contrast)) / 2
    for number, (one, other) in pairs.items():
        step = one.astype(np.float32) - other.astype(np.float32)
        seen = np.abs(step) > WELL_SEEN * np.maximum(contrast, 1.0)
        if (seen & lit).sum() < WELL_SEEN * lit.sum():
            continue
        grid, known = (step > 0).reshape(shape), (seen & lit).reshape(shape)
        changes = int(((grid[:, 1:] != grid[:, :-1]) & known[:, 1:] & known[:, :-1]).sum())
        if changes:
            found[number] = changes
    return tuple(dict.fromkeys(ends(found, key=lambda n: found[n]) for ends in (max, min))) if found else ()


def is_same(seen: Counts, before: Counts, pairs: Mapping[int, Pair], noise: Noise) -> bool:
    """Whether a picture shows what it showed ``before``, as far as light reaches."""
    contrast = _contrast(pairs.values())
    return alike(seen, before, contrast, contrast > LIT_SIGMAS * np.sqrt(noise.variance(before)))


def is_unchanged(seen: Counts, before: Counts, pairs: Mapping[int, Pair], noise: Noise) -> bool:
    """Whether a picture shows what it showed ``before`` in the same light, with the same contrast.

    What changes slowly, such as mist or focus, is the same for long, and not unchanged.
    """
    if not is_same(seen, before, pairs, noise):
        return False
    lit = _contrast(pairs.values()) > LIT_SIGMAS * np.sqrt(noise.variance(before))
    old, new = (each[lit] - each[lit].mean(dtype=np.float64) for each in (before, seen))
    power = float(old @ old)
    return power > 0 and abs(float(old @ new) / power - 1) < UNCHANGED


def edges_moved(seen: Counts, before: Counts, pairs: Mapping[int, Pair], noise: Noise) -> bool:
    """Whether edges of a picture of the code are where they were ``before``, in whatever light.

    The first picture of a code has so few edges that hardly anything of it changes when it is displaced; but
    pixels there change from light to dark, and no noise does that.
    """
    every = [picture for pair in pairs.values() for picture in pair]
    dark, contrast = np.minimum.reduce(every).astype(np.float32), _contrast(pairs.values())
    sigma = np.sqrt(noise.variance(before) + noise.variance(seen))
    lit = contrast > LIT_SIGMAS * sigma
    old, new = ((each[lit] - dark[lit]) / contrast[lit] for each in (before, seen))
    was_bright = old > 0.5
    if min(int(was_bright.sum()), int((~was_bright).sum())) < FEWEST_CHANGED:
        return False
    low, high = (float(np.median(new[part])) for part in (~was_bright, was_bright))
    if high - low < LEAST_CONTRAST:
        return False
    new = (new - low) / (high - low)
    changed = ((new > 0.5) != was_bright) & (np.abs(new - old) > CHANGED)
    return FEWEST_CHANGED <= int(changed.sum()) < MOST_CHANGED * old.size


def _contrast(pairs: Iterable[Pair]) -> Floats:
    """Brightest less darkest counts of each pixel."""
    pictures = [picture for pair in pairs for picture in pair]
    low, high = np.minimum.reduce(pictures), np.maximum.reduce(pictures)
    return np.asarray(high.astype(np.float32) - low.astype(np.float32))
