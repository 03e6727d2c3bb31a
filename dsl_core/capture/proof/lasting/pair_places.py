"""Whether inverses of a code are shown where their patterns are: a projector may shift every other picture.

A pattern and its inverse add up to white. Where the inverse is displaced, both light the edges of stripes on
one side, and neither does on the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dsl_core.capture.proof.code.code_pairs import Pair
from dsl_core.capture.proof.prediction import Lit
from dsl_core.model.plan import BinaryCode
from dsl_core.patterns.binary_code import stripes_across
from dsl_core.solve.robust import robust_std

#: Columns by which an inverse may be off, and in deviations; clean scans of all scenes differ by a quarter.
LEAST, SIGMAS = 0.3, 6.0
#: Pairs that have to agree: what moved between two pictures displaces one.
FEWEST = 2
#: Edges are compared over this width, columns (rms): what lenses, film and pixels spread.
WIDTH = 2.0
#: A pair says something where its place is known by so many columns.
KNOWN = 0.1
#: Light of a column rises by less than this away from edges; so many such pixels say how noisy sums are.
FLAT, FEWEST_FLAT = 0.002, 60


@dataclass(frozen=True)
class PairPlaces:
    """By how many ``columns`` inverses are displaced against their patterns, the median of those that are.

    How wide an edge is on the camera is not known to better than a third, and so are they.
    """

    columns: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        return (
            f"Patterns of the code and their inverses are displaced against each other by about"
            f" {abs(self.columns):.1f} columns, edge by edge: the projector shows every"
            " other picture next to its place (pixel shift, 4K enhancement), or picture and camera"
            " tremble. Switch such modes off, wait until nothing vibrates, and scan again."
        )


def pair_places(
    code: BinaryCode, size_px: tuple[int, int], pairs: Mapping[int, Pair], lit: Lit
) -> PairPlaces | None:
    """Where inverses of the ``pairs``, rasters by their number, are displaced; None if they are not.

    ``size_px`` is the projector's. Raises `PlanError`.
    """
    column = lit.key // 3
    found = []
    for number, (one, other) in pairs.items():
        stripes = stripes_across(code, size_px, 2 * number)
        if stripes is None:
            continue
        slope = _slope(np.asarray(stripes, np.float32))[column]
        if not slope.any():
            continue
        apart = one[lit.index].astype(np.float32) + other[lit.index] - 2 * lit.black
        apart = apart / lit.contrast - 1
        apart -= np.median(apart)
        sigma = lit.sigma / lit.contrast
        flat = np.abs(slope) < FLAT
        if int(flat.sum()) >= FEWEST_FLAT:
            # Texture, and light that changed, count as noise does: as much as they do away from edges.
            sigma = sigma * max(1.0, float(robust_std(apart[flat] / sigma[flat])))
        # Values that are not proportional to the light make edges brighter that rise and those that fall.
        steep = np.abs(slope)
        odd = slope - steep * np.average(np.sign(slope), weights=(slope / sigma) ** 2)
        weight = odd / sigma**2
        total = float(weight @ odd)
        if total <= 0:
            continue
        moved, std = float(weight @ apart) / total, total**-0.5
        if std < KNOWN:
            found.append((moved, std))
    off = [(moved, std) for moved, std in found if abs(moved) > LEAST + SIGMAS * std]
    if len(off) < FEWEST or len({moved > 0 for moved, _ in off}) > 1:
        return None
    return PairPlaces(float(np.median([moved for moved, _ in off])))


def _slope(profile: np.ndarray) -> np.ndarray:
    """How steeply light rises from column to column, as a camera sees it."""
    away = np.arange(-4 * int(WIDTH), 4 * int(WIDTH) + 1)
    kernel = np.exp(-0.5 * (away / WIDTH) ** 2)
    wide = np.pad(profile, away.size // 2, mode="edge")
    return np.asarray(np.gradient(np.convolve(wide, kernel / kernel.sum(), "valid")), np.float32)
