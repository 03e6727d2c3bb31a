"""The result that is open, how it is looked at, and what was marked on it."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsl_app.shared.evented import Value
from dsl_app.shared.spectrum import Floats, Pixel, Spectrum, spectrum_of_pixel
from dsl_core.evaluation.similarity import Likeness
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.spectra.reference_file import ReferenceFile
from dsl_core.model.spectral import SpectralCurve
from dsl_core.workflows.inspection import IntensityGraph

#: The nearest and the farthest of something, mm.
Limits = tuple[float, float]
_keys = itertools.count(1)


class View(Enum):
    """The five ways to look at a result, on keys 1 to 5; the value is the key of the action."""

    COLOUR = "view_colour"
    BAND = "view_band"
    DEPTH = "view_depth"
    QUALITY = "view_quality"
    CLOUD = "view_cloud"


class Tool(Enum):
    """What the mouse does on the picture."""

    PIN = "pin"
    RECTANGLE = "rectangle"
    ELLIPSE = "ellipse"
    POLYGON = "polygon"
    LASSO = "lasso"


class Quality(Enum):
    """What the quality view shows."""

    FLAGS = "reasons"
    ORDERS = "orders of the band"
    SHARE = "data share of the band"
    SPREAD = "deviation of the band"
    DEPTH_SPREAD = "deviation of depth"


# Equal only to itself: arrays of spectra have no single truth of equality, nor need tuples of marks one.
@dataclass(frozen=True, eq=False)
class Mark:
    """A pin, a region or a reference: anything with a name, a colour and a spectrum.

    ``colour`` counts through the theme's colours of pins. A region has an outline, or runs of pixels (row,
    first column, columns) where it was marked in 3D; ``pixels`` lie in it, ``used`` have a spectrum, and
    ``pixel_std`` is the mean uncertainty that is stated for one of them. A reference has a ``file``, and is
    called ``entry`` there where the file holds several. ``trouble`` says why a mark that was kept has no
    spectrum now; empty when it has one.
    """

    kind: Literal["pin", "region", "reference"]
    name: str
    colour: int
    spectrum: Spectrum
    shown: bool = True
    pixel: Pixel | None = None
    outline_px: tuple[tuple[float, float], ...] = ()
    runs: tuple[tuple[int, int, int], ...] = ()
    pixels: int = 0
    used: int = 0
    pixel_std: Floats | None = None
    file: Path | None = None
    entry: str = ""
    curve: SpectralCurve | None = None
    trouble: str = ""
    key: int = field(default_factory=lambda: next(_keys))


@dataclass(frozen=True)
class Library:
    """A file with several reference spectra, of which some are to be chosen."""

    path: Path
    content: ReferenceFile


class Seek(Enum):
    """What is looked for in the whole picture."""

    SPECTRUM = "same spectrum"
    METAMERS = "same colour, other spectrum"


@dataclass(frozen=True)
class Search:
    """A search for the spectrum of a mark or pixel, with its limits."""

    name: str
    likeness: Likeness
    seek: Seek = Seek.SPECTRUM
    within_rad: float = 0.05
    within_delta_e: float = 2.0

    @property
    def found(self) -> NDArray[np.bool_]:
        """Pixels that the limits let through."""
        if self.seek is Seek.SPECTRUM:
            return self.likeness.same_spectrum(self.within_rad)
        return self.likeness.metamers(self.within_delta_e, self.within_rad)

    @property
    def share(self) -> float | None:
        """Share of the pixels with a spectrum that are found; None where no pixel has one."""
        known = int(np.isfinite(self.likeness.angle_rad).sum())
        return int(self.found.sum()) / known if known else None


class ResultsState:
    """Values that the results' controllers set and the page follows.

    ``offer`` is a complete scan that could be reconstructed. ``picture`` is the colour image as RGBA bytes;
    it follows ``light`` and ``adapted`` once it is computed. ``cloud_by`` is the view that colours the cloud;
    ``busy`` says in words what is being opened (empty: nothing). ``graph`` is what the pixel saw that was
    last inspected; ``library`` waits for somebody to choose of it. ``depth_limits`` are the depths that are
    shown, mm; None for all.
    """

    def __init__(self) -> None:
        self.result: Value[ResultArrays | None] = Value(None)
        self.offer: Value[Path | None] = Value(None)
        self.busy = Value("")
        self.view = Value(View.COLOUR)
        self.cloud_by = Value(View.COLOUR)
        self.tool = Value(Tool.PIN)
        self.band = Value(0)
        self.quality = Value(Quality.FLAGS)
        self.depth_limits: Value[Limits | None] = Value(None)
        self.cursor: Value[Pixel | None] = Value(None)
        self.marks: Value[tuple[Mark, ...]] = Value(())
        self.selected = Value(0)
        self.picture: Value[NDArray[np.uint8] | None] = Value(None)
        self.light = Value("D65")
        self.adapted = Value(True)
        self.search: Value[Search | None] = Value(None)
        self.graph: Value[IntensityGraph | None] = Value(None)
        self.library: Value[Library | None] = Value(None)

    @property
    def selected_mark(self) -> Mark | None:
        """The mark that is selected."""
        return next((mark for mark in self.marks.value if mark.key == self.selected.value), None)

    def spectrum_at(self, pixel: Pixel) -> Spectrum | None:
        """The spectrum of a pixel; None where the result has none."""
        result = self.result.value
        return None if result is None else spectrum_of_pixel(result, pixel)
