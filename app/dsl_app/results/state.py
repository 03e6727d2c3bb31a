"""The open result, how it is viewed, and what is marked on it."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from dsl_app.shared.evented import Event, Value
from dsl_app.shared.spectrum import Floats, Pixel, Spectrum, spectrum_of_pixel
from dsl_core.analysis.band_noise import correlation_of
from dsl_core.analysis.transforms import Transform
from dsl_core.evaluation.similarity import Likeness
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.spectra.reference_file import ReferenceFile
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.levels import Bands, Levels

if TYPE_CHECKING:
    # Not needed before the first picture of a result.
    from dsl_core.analysis.classification import Classification
    from dsl_core.workflows.inspection import IntensityGraph

#: A nearest and a farthest depth, mm.
Limits = tuple[float, float]
#: The light that colours are first shown under.
DAYLIGHT = "D65"
#: Keys of the levels of true colours, of three bands as colours, and of one band.
COLOUR_KEY, BANDS_KEY, BAND_KEY = "rgb", "bands", "reflectance"
_keys = itertools.count(1)


def within(depth_mm: NDArray[np.floating], limits: Limits | None) -> NDArray[np.bool_]:
    """Where there is a depth within the limits; without limits, where there is one at all."""
    shown: NDArray[np.bool_] = np.isfinite(depth_mm)
    if limits is not None:
        shown &= (depth_mm >= limits[0]) & (depth_mm <= limits[1])
    return shown


def depth_key(limits: Limits | None) -> str:
    """The key of the depth picture's levels: other limits begin with levels of their own."""
    return "depth_mm" if limits is None else f"depth_mm {limits[0]:g} {limits[1]:g}"


class ResultView(Enum):
    """The five views of a result, on keys 1 to 5; the value is the key of the action."""

    COLOUR = "view_colour"
    BAND = "view_band"
    DEPTH = "view_depth"
    QUALITY = "view_quality"
    CLOUD = "view_cloud"


#: What a result of depth alone cannot show.
NEED_SPECTRA = (ResultView.COLOUR, ResultView.BAND)


class Tool(Enum):
    """What the mouse does on the picture."""

    PIN = "pin"
    RECTANGLE = "rectangle"
    ELLIPSE = "ellipse"
    POLYGON = "polygon"
    LASSO = "lasso"


class QualityMap(Enum):
    """What the quality view shows."""

    FLAGS = "reasons"
    ORDERS = "orders of the band"
    SHARE = "data share of the band"
    SPREAD = "deviation of the band"
    DEPTH_SPREAD = "deviation of depth"


# Equal only to itself: comparing arrays of spectra gives no single truth value.
@dataclass(frozen=True, eq=False)
class Mark:
    """A pin, a region or a reference: anything with a name, a colour and a spectrum.

    ``colour`` is an index into the theme's pin colours. A region has an outline, or runs of pixels (row,
    first column, columns) when it was marked in 3D; of its ``pixels``, ``used`` have a spectrum, and
    ``pixel_std`` is the mean uncertainty stated for one of them. A reference has a ``file``, in which
    ``entry`` names it if there are several. ``trouble`` says why a saved mark has no spectrum now; empty when
    it has one.
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

    @property
    def band_std(self) -> Floats | None:
        """What is stated for its bands: of a region, for one of its pixels; None where nothing is."""
        return self.spectrum.std if self.pixel_std is None else self.pixel_std


@dataclass(frozen=True)
class Library:
    """A file with several reference spectra to choose from."""

    path: Path
    content: ReferenceFile


class SearchMode(Enum):
    """What to search the picture for."""

    SPECTRUM = "same spectrum"
    METAMERS = "same colour, different spectrum"


@dataclass(frozen=True)
class Search:
    """A search for the spectrum of a mark or pixel, with its limits.

    ``noise_rad`` (rows, columns) is the angle that deviations make alone; None where they are not known.
    """

    name: str
    likeness: Likeness
    mode: SearchMode = SearchMode.SPECTRUM
    within_rad: float = 0.05
    within_delta_e: float = 2.0
    noise_rad: Floats | None = None

    @property
    def found(self) -> NDArray[np.bool_]:
        """Pixels within the limits."""
        if self.mode is SearchMode.SPECTRUM:
            return self.likeness.same_spectrum(self.within_rad)
        return self.likeness.metamers(self.within_delta_e, self.within_rad)

    @property
    def share(self) -> float | None:
        """Share found of the pixels that have a spectrum or colour; None where no pixel has one."""
        is_spectral = self.mode is SearchMode.SPECTRUM
        known = int(np.isfinite(self.likeness.angle_rad if is_spectral else self.likeness.delta_e).sum())
        return int(self.found.sum()) / known if known else None

    @property
    def noise_of_alike_rad(self) -> float:
        """The angle that deviations make alone in most pixels of the same colour; 0 if it is not known.

        Where no pixel has a colour, all count that have a spectrum.
        """
        if self.noise_rad is None:
            return 0.0
        known = np.isfinite(self.likeness.angle_rad)
        noise = self.noise_rad[known & ~(self.likeness.delta_e > self.within_delta_e)]
        return float(np.median(noise)) if noise.size else 0.0


@dataclass(frozen=True, eq=False)
class Materials:
    """The materials of the pixels: where the classes are from, the map, and notes on the classes."""

    name: str
    found: Classification
    of_classes: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What there is to tell of the map under its limits, then of the classes."""
        return (*self.found.notes, *self.of_classes)


class ResultsState:
    """Values that the controllers of results set and the page follows.

    ``is_begun`` says that the ``result`` is the depth of one whose spectra are being computed, and is on no
    disk yet. ``offer`` is a complete scan that could be reconstructed. ``picture`` is the colour image as
    RGBA bytes, computed for ``picture_light``, which follows the chosen ``light`` and ``adapted`` later.
    ``cloud_by`` is the view that colours the cloud; ``busy`` says what is being opened (empty: nothing).
    ``graph`` is the intensity graph of the pixel inspected last; ``library`` is a file whose spectra the user
    has to choose from. ``depth_limits`` are the depths shown, mm; None for all. ``bands`` are shown as
    colours; None for true colours. ``levels`` has what a person set by the key of `layers.Contrast`, and
    ``contrast`` says whether a histogram is shown. The plot draws a ``transform`` of the spectra, one above
    the other if ``stacked``. ``opened`` fires with a file to open in the system's program.
    """

    def __init__(self) -> None:
        self.result: Value[ResultArrays | None] = Value(None)
        self.is_begun = Value(False)
        self.offer: Value[Path | None] = Value(None)
        self.busy = Value("")
        self.view = Value(ResultView.COLOUR)
        self.cloud_by = Value(ResultView.COLOUR)
        self.tool = Value(Tool.PIN)
        self.band = Value(0)
        self.quality = Value(QualityMap.FLAGS)
        self.depth_limits: Value[Limits | None] = Value(None)
        self.bands: Value[Bands | None] = Value(None)
        self.levels: Value[Mapping[str, Levels]] = Value({})
        self.contrast = Value(False)
        self.cursor: Value[Pixel | None] = Value(None)
        self.marks: Value[tuple[Mark, ...]] = Value(())
        self.selected = Value(0)
        self.picture: Value[NDArray[np.uint8] | None] = Value(None)
        self.light = Value(DAYLIGHT)
        self.adapted = Value(True)
        self.picture_light = Value((DAYLIGHT, True))
        self.search: Value[Search | None] = Value(None)
        self.materials: Value[Materials | None] = Value(None)
        self.transform = Value(Transform.NONE)
        self.stacked = Value(False)
        self.graph: Value[IntensityGraph | None] = Value(None)
        self.library: Value[Library | None] = Value(None)
        self.opened: Event[Path] = Event()
        self._correlation: tuple[ResultArrays, NDArray[np.float64]] | None = None

    @property
    def saved_result(self) -> ResultArrays | None:
        """The open result, unless it has only begun and cannot be written, marked or compared yet."""
        return None if self.is_begun.value else self.result.value

    @property
    def hidden(self) -> str:
        """Why nothing is done with the open result; empty where it is shown, or none is open."""
        if self.offer.value is None or self.saved_result is None:
            return ""
        return "A scan is offered in place of the result. Choose 'Not now' to return to the result."

    @property
    def no_spectra(self) -> str:
        """Why the open result shows no spectra; empty where it has them, or none is open."""
        result = self.result.value
        if result is None or result.has_spectra:
            return ""
        if self.is_begun.value:
            return "The spectra are still being computed."
        return "This result has depth only. Reconstruct the scan with spectra to see them."

    def band_correlation(self, result: ResultArrays) -> NDArray[np.float64]:
        """How the bands (bands, bands) of the open result with spectra err together, learned once."""
        if self._correlation is None or self._correlation[0] is not result:
            names = ("reflectance_std", "flags")
            std, flags = (result.known(name) for name in names)
            found = correlation_of(result.wavelengths_nm, result["reflectance"], std, flags)
            self._correlation = result, found
        return self._correlation[1]

    @property
    def selected_mark(self) -> Mark | None:
        """The selected mark."""
        return next((mark for mark in self.marks.value if mark.key == self.selected.value), None)

    def spectrum_at(self, pixel: Pixel) -> Spectrum | None:
        """The spectrum of a pixel; None where the result has none."""
        result = self.result.value
        return None if result is None else spectrum_of_pixel(result, pixel)
