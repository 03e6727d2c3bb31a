"""Whether the code got the light that white got: a pattern and its inverse together are white and black.

That holds for every pixel, whatever surfaces do with the light. Where all pairs of a code break it alike, the
projector gives pictures of another mean brightness another share of its light. Where only those pixels do to
which both patterns give a part of the light, at the edges of stripes, light is not proportional to counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

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
#: one of them gives it less than that.
AT_EDGE, AWAY = 0.2, 0.1
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
    # Half of the pixels have most of the light.
    at = lit.index[lit.contrast >= np.median(lit.contrast)] if lit.index.size else lit.index
    if at.size < FEWEST:
        return None
    white, black = (each[at].astype(np.float32) for each in ends)
    light = white - black
    variance = noise.variance(ends[0])[at] + noise.variance(ends[1])[at]
    shares: dict[int, float] = {}
    edges: list[tuple[float, float, float]] = []
    for number, pair in pairs.items():
        one, other = (each[at].astype(np.float32) - black for each in pair)
        fainter, total = np.minimum(one, other), one + other
        away, edge = fainter < AWAY * light, fainter > AT_EDGE * light
        if int(away.sum()) < FEWEST:
            continue
        shares[number] = _ratio(total[away], light[away])
        wanted = float(light[edge].sum(dtype=np.float64))
        if wanted > 0:
            more = float(total[edge].sum(dtype=np.float64)) - shares[number] * wanted
            edges.append((more, wanted, 4 * float(variance[edge].sum())))
    if len(shares) < 3:
        return None
    values = np.array(list(shares.values()))
    share = float(np.median(values))
    std = 2 * float(np.sqrt(variance.sum())) / float(light.sum())
    std = float(np.hypot(std, np.median(np.abs(values - share)) / np.sqrt(len(values))))
    allowed = LEAST + SIGMAS * std + 2 * UNSEEN_DN / float(light.mean())
    one, other = (each[at].astype(np.float32) - black for each in pairs[max(pairs)])
    last = _ratio(one + other, light) - 1
    if last * (share - 1) < LAST * (share - 1) ** 2:
        allowed = np.inf
    more, wanted, noises = np.sum(edges, 0) if edges else (0.0, 0.0, 0.0)
    if wanted < FEWEST_EDGES * float(light.mean()):
        return CodeSum(share, std, allowed, 0.0, np.inf)
    return CodeSum(share, std, allowed, float(more / wanted), float(np.sqrt(noises) / wanted))


def _ratio(seen: np.ndarray, wanted: np.ndarray) -> float:
    return float(seen.sum(dtype=np.float64) / wanted.sum(dtype=np.float64))
