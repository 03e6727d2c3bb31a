"""A picture of the first code that, taken once more, shows whether devices and scene are as they were."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import Pair, alike
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Floats

#: Stripes are well seen by a pixel, or by so many of those that are lit, with this share of the contrast.
WELL_SEEN = 0.7
#: Contrast and light relative to what they were that are no change, and what single pixels may be off by as a
#: share of the contrast, beyond their noise and so much more of its variance.
UNCHANGED, MORE_NOISE = 0.03, 0.5
#: A pixel is lit with a contrast of so many deviations.
LIT_SIGMAS = 12.0
#: Edges of a pattern have moved from so many camera pixels and deviations on.
MOVED_PX, MOVED_SIGMAS = 0.06, 4.0
#: Pixels are near an edge if light changes there by this share of the contrast from pixel to pixel; so many
#: have to be, or have to be lit.
STEEP, FEWEST_NEAR = 0.15, 24


def choose_pairs(pairs: Mapping[int, Pair], shape: tuple[int, int], noise: Noise) -> tuple[int, ...]:
    """The pairs with the most and the fewest stripes of those well seen; ``shape`` is that of the raster.

    Stripes rather than white: they move when anything does. The widest are not their own mirror image, as all
    others of a Gray code are. None where too few pixels are lit to tell one pattern from another.
    """
    if not pairs:
        return ()
    found: dict[int, int] = {}
    contrast = _contrast(pairs.values())
    lit = contrast > float(np.median(contrast)) / 2
    for number, (one, other) in pairs.items():
        step = one.astype(np.float32) - other.astype(np.float32)
        seen = np.abs(step) > WELL_SEEN * np.maximum(contrast, 1.0)
        told = int(_is_told(one, contrast, noise).sum())
        if (seen & lit).sum() < WELL_SEEN * lit.sum() or told < FEWEST_NEAR:
            continue
        grid, known = (step > 0).reshape(shape), (seen & lit).reshape(shape)
        changes = int(((grid[:, 1:] != grid[:, :-1]) & known[:, 1:] & known[:, :-1]).sum())
        if changes:
            found[number] = changes
    return tuple(dict.fromkeys(ends(found, key=lambda n: found[n]) for ends in (max, min))) if found else ()


def _is_told(picture: Counts, contrast: Floats, noise: Noise) -> NDArray[np.bool_]:
    return np.asarray(contrast > LIT_SIGMAS * np.sqrt(noise.variance(picture)))


def is_same(seen: Counts, before: Counts, pairs: Mapping[int, Pair], noise: Noise) -> bool:
    """Whether a picture shows what it showed ``before``, as far as light reaches, whatever noise does."""
    contrast = _contrast(pairs.values())
    told = _is_told(before, contrast, noise)
    sigma = np.sqrt((noise.variance(before) + noise.variance(seen))[told])
    usual = math.sqrt(2 / math.pi) * float((sigma / contrast[told]).mean()) if told.any() else 0.0
    return alike(seen, before, contrast, told, usual)


def is_unchanged(seen: Counts, before: Counts, pairs: Mapping[int, Pair], noise: Noise) -> bool:
    """Whether a picture shows what it showed ``before`` in the same light, with the same contrast.

    What changes slowly, such as mist or focus, is the same for long, and not unchanged; nor are colours whose
    gain the camera sets by what it sees.
    """
    if not is_same(seen, before, pairs, noise):
        return False
    lit = _contrast(pairs.values()) > LIT_SIGMAS * np.sqrt(noise.variance(before))
    level = noise.sensor.black_level_dn
    light = [float(each[lit].mean(dtype=np.float64)) for each in (before, seen)]
    old, new = (each[lit] - mean for each, mean in zip((before, seen), light, strict=True))
    power = float(old @ old)
    if power <= 0 or abs((light[1] - level) / max(light[0] - level, 1.0) - 1) > UNCHANGED:
        return False
    contrast = float(old @ new) / power
    usual = float((noise.variance(before) + noise.variance(seen))[lit].sum(dtype=np.float64))
    left = float(((new - contrast * old) ** 2).sum()) - (1 + MORE_NOISE) * usual
    return abs(contrast - 1) < UNCHANGED and left < UNCHANGED**2 * power


def edges_moved(
    seen: Counts,
    before: Counts,
    pairs: Mapping[int, Pair],
    noise: Noise,
    shape: tuple[int, int],
    channels: NDArray[np.int8],
) -> bool:
    """Whether edges of a picture of the code are not where they were ``before``, in whatever light.

    A pixel may see several columns of the projector, so that a displaced picture changes little of each; all
    pixels near an edge together tell. ``shape`` is that of the raster, ``channels`` the colour of each pixel.
    """
    every = [picture for pair in pairs.values() for picture in pair]
    dark, contrast = np.minimum.reduce(every).astype(np.float32), _contrast(pairs.values())
    sigma = np.sqrt(noise.variance(before) + noise.variance(seen))
    lit = (contrast > LIT_SIGMAS * sigma).reshape(shape)
    share = np.maximum(contrast, 1.0)
    old, new = (((each - dark) / share).reshape(shape) for each in (before, seen))
    slope = np.zeros(shape)
    slope[:, 1:-1] = (old[:, 2:] - old[:, :-2]) / 2
    sound = lit.copy()
    sound[:, 1:-1] &= lit[:, 2:] & lit[:, :-2]
    sound[:, [0, -1]] = False
    steep = sound & (np.abs(slope) > STEEP)
    near = steep.copy()
    near[:, 1:] |= steep[:, :-1]
    near[:, :-1] |= steep[:, 1:]
    near &= sound
    if int(steep.sum()) < FEWEST_NEAR:
        return False
    # Light of the projector and of the room may have changed meanwhile, and the camera's balance of colours.
    own = [channels.reshape(shape)[near] == colour for colour in np.unique(channels)]
    terms = np.stack([slope[near], *(old[near] * each for each in own), *own], 1)
    found, *_ = np.linalg.lstsq(terms, new[near] - old[near], rcond=None)
    left = new[near] - old[near] - terms @ found
    deviation = np.maximum(sigma.reshape(shape)[near] / share.reshape(shape)[near], left.std())
    std_px = float(np.sqrt(np.linalg.pinv((terms / deviation[:, None] ** 2).T @ terms)[0, 0]))
    return abs(float(found[0])) > max(MOVED_PX, MOVED_SIGMAS * std_px)


def _contrast(pairs: Iterable[Pair]) -> Floats:
    """Brightest less darkest counts of each pixel."""
    pictures = [picture for pair in pairs for picture in pair]
    low, high = np.minimum.reduce(pictures), np.maximum.reduce(pictures)
    return np.asarray(high.astype(np.float32) - low.astype(np.float32))
