"""Whether the code got the light that white got: a pattern and its inverse together are white and black.

That holds for every pixel, whatever surfaces do with the light. Where all pairs of a code break it alike, the
projector gives pictures of another mean brightness another share of its light. Where only those pixels do to
which both patterns give a part of the light, at the edges of stripes, light is not proportional to counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import Pair
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts

#: How far the sums may be from white, and from each other: what clean scans of all scenes differ by is a
#: fifth of this.
LEAST, LEAST_CURVE, SIGMAS = 0.02, 0.06, 5.0
#: What black may have changed by unseen, DN.
UNSEEN_DN = 0.5
#: The last pair, just before white, has to differ by this share of what most pairs do: light that changes
#: while the code is captured is no matter of bright and dark pictures.
LAST = 0.4
#: A pixel is at an edge if both patterns give it more than this share of its light, and away from edges if
#: one of them gives it less than that; where so many deviations of noise are less than lies between.
AT_EDGE, AWAY, EDGE_SIGMAS = 0.2, 0.1, 3.0
#: Pixels needed to say anything, and those at edges, of all pairs together.
FEWEST, FEWEST_EDGES = 60, 24


@dataclass(frozen=True)
class CodeSum:
    """Light of pairs of a code over that of white: ``share`` of most pairs away from edges of stripes.

    ``curve`` is by how much it is more at edges. With deviations, and how far off both may be.
    """

    share: float
    std: float
    allowed: float
    curve: float
    curve_std: float

    @property
    def is_curved(self) -> bool:
        """Whether counts are not proportional to light."""
        return abs(self.curve) > LEAST_CURVE + SIGMAS * self.curve_std

    @property
    def is_uneven(self) -> bool:
        """Whether the code has another share of the light than white."""
        return not self.is_curved and abs(self.share - 1) > self.allowed


def code_sum(
    pairs: Mapping[int, Pair], ends: tuple[Counts, Counts], lit: Lit, noise: Noise
) -> CodeSum | None:
    """The sums of ``pairs``, by their number, over those of the ``ends``, white and black.

    None where pairs say too little: there are fewer than three, or few pixels are ``lit``.
    """
    if lit.index.size < FEWEST or len(pairs) < 3:
        return None
    white, black = (each[lit.index].astype(np.float32) for each in ends)
    light = white - black
    noises = (noise.variance(ends[0]) + noise.variance(ends[1]))[lit.index]
    parts = {n: tuple(each[lit.index].astype(np.float32) for each in pair) for n, pair in pairs.items()}
    colours = [lit.key % 3 == colour for colour in range(3)]
    together = np.sum([one + other for one, other in parts.values()], axis=0)

    shares: dict[int, float] = {}
    edges: list[tuple[float, float, float]] = []
    for number, (seen, inverse) in parts.items():
        one, other = seen - black, inverse - black
        at = _brighter(together - seen - inverse)
        fainter, total = np.minimum(one, other), one + other
        away = at & (fainter < AWAY * light)
        # Noise would make edges of pixels away from them, of which there are many more.
        sigma = np.sqrt(noise.variance(np.minimum(*pairs[number]))[lit.index])
        edge = at & (fainter > AT_EDGE * light) & (EDGE_SIGMAS * sigma < (AT_EDGE - AWAY) * light)
        if int(away.sum()) < FEWEST:
            continue
        shares[number] = _ratio(total[away], light[away])
        # Colours that a camera balances otherwise are no curve: edges have other pixels of each.
        usual = np.full(light.size, shares[number])
        for own in colours:
            if int((away & own).sum()) >= FEWEST:
                usual[own] = _ratio(total[away & own], light[away & own])
        wanted = float(light[edge].sum(dtype=np.float64))
        if wanted > 0:
            more = float((total - usual * light)[edge].sum(dtype=np.float64))
            edges.append((more, wanted, 4 * float(noises[edge].sum())))
    if len(shares) < 3:
        return None
    values = np.array(list(shares.values()))
    share = float(np.median(values))
    final = np.add(*parts[max(pairs)])
    at = _brighter(together - final)
    mean = float(light[at].mean())
    std = 2 * float(np.sqrt(noises[at].sum())) / float(light[at].sum())
    std = float(np.hypot(std, np.median(np.abs(values - share)) / np.sqrt(len(values))))
    allowed = LEAST + SIGMAS * std + 2 * UNSEEN_DN / mean
    last = _ratio((final - 2 * black)[at], light[at]) - 1
    if last * (share - 1) < LAST * (share - 1) ** 2:
        allowed = np.inf
    more, wanted, spread = np.sum(edges, 0) if edges else (0.0, 0.0, 0.0)
    if wanted < FEWEST_EDGES * mean:
        return CodeSum(share, std, allowed, 0.0, np.inf)
    return CodeSum(share, std, allowed, float(more / wanted), float(np.sqrt(spread) / wanted))


def _brighter(others: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Half of the pixels, which have most of the light, by the sum of all pairs but the one that is compared.

    Chosen by white, it would be brighter than the pair by its noise.
    """
    return np.asarray(others >= np.median(others))


def _ratio(seen: np.ndarray, wanted: np.ndarray) -> float:
    return float(seen.sum(dtype=np.float64) / wanted.sum(dtype=np.float64))
