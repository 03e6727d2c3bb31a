"""Two results, or a result and its truth, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_app.shared.evented import Value
from dsl_app.shared.spectrum import Pixel
from dsl_core.evaluation.summary import Truth
from dsl_core.evaluation.verdict import Verdict
from dsl_core.io.result.result_arrays import ResultArrays

Floats = NDArray[np.floating[Any]]


class Shown(Enum):
    """What the three pictures show."""

    DEPTH = "Depth"
    BAND = "Band"


@dataclass(frozen=True)
class Side:
    """A result with a name; ``truth`` is there where it is what a twin knows of its scene."""

    name: str
    arrays: ResultArrays
    truth: Truth | None = None


@dataclass(frozen=True)
class Pair:
    """Two sides that fit each other; differences are A minus B.

    ``bands`` pairs the bands of A and B that lie at the same wavelength; ``rows`` are the figures.
    """

    first: Side
    second: Side
    bands: tuple[tuple[int, int], ...]
    rows: tuple[Verdict, ...]

    def images(self, shown: Shown, band: int) -> tuple[Floats, Floats] | None:
        """A and B as images (h, w); None where they have nothing of that kind in common."""
        if shown is Shown.DEPTH:
            return self.first.arrays["depth_mm"], self.second.arrays["depth_mm"]
        if not 0 <= band < len(self.bands):
            return None
        i, k = self.bands[band]
        return self.first.arrays["reflectance"][i], self.second.arrays["reflectance"][k]

    def nm(self, band: int) -> float:
        """Wavelength of a common band."""
        return float(self.first.arrays.wavelengths_nm[self.bands[band][0]])


class CompareState:
    """Values that the comparison's controller sets and the page follows.

    ``busy`` says in words what is being read or compared (empty: nothing); ``trouble`` why two sides cannot
    be compared.
    """

    def __init__(self) -> None:
        self.first: Value[Side | None] = Value(None)
        self.second: Value[Side | None] = Value(None)
        self.pair: Value[Pair | None] = Value(None)
        self.shown = Value(Shown.DEPTH)
        self.band = Value(0)
        self.cursor: Value[Pixel | None] = Value(None)
        self.busy = Value("")
        self.trouble = Value("")
