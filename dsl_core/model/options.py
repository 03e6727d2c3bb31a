"""How to reconstruct: options, and the choices that the command line and the window offer by name."""

from __future__ import annotations

from dataclasses import dataclass, field

from dsl_core.model.spectral import WavelengthGrid


@dataclass(frozen=True)
class SpectralChoice:
    """A way with its name on the command line, its title in the window, and what it does and costs."""

    name: str
    title: str
    about: str


#: How the place of each wavelength is computed.
MODELS: tuple[SpectralChoice, ...] = (
    SpectralChoice("auto", "Best model in the calibration", "hybrid, else the grid, else the grating"),
    SpectralChoice(
        "grating",
        "Grating equation alone",
        "the film's pose and form alone; leaves out what no formula describes",
    ),
    SpectralChoice("hybrid", "Grating equation and measured residual", "needs a calibrated depth stage"),
    SpectralChoice("grid", "Measured grid", "as published; needs a grid measured on the depth stage"),
)

#: How spectra are solved for.
SOLVERS: tuple[SpectralChoice, ...] = (
    SpectralChoice("best", "Best estimate", "every frame by its noise, with an uncertainty for each band"),
    SpectralChoice(
        "published",
        "As published",
        "Adam on the published objective; many times slower, no uncertainties",
    ),
    SpectralChoice("nearest-line", "Nearest line", "one frame per band; quick, noisy, no uncertainties"),
    SpectralChoice("colour-basis", "Colour alone", "from three colours; quickest, a guess, no uncertainties"),
)


def names(choices: tuple[SpectralChoice, ...]) -> tuple[str, ...]:
    """The names of choices, in their order.

    >>> names(MODELS)
    ('auto', 'grating', 'hybrid', 'grid')
    """
    return tuple(choice.name for choice in choices)


@dataclass(frozen=True)
class Options:
    """How to reconstruct: bands, correspondence (auto, grating, hybrid, grid), refinement, torch device.

    ``solver`` is ``best`` or, to compare with it, ``published`` (Adam on the published objective),
    ``nearest-line`` or ``colour-basis``. ``surface_window_px`` is the window of normals; None takes it from
    the image's width, which is wrong for a piece cut out of a larger image. ``as_calibrated`` corrects
    nothing in the calibration by what the scan itself shows, nor does ``refine_columns`` False: columns of
    the code alone are too coarse to judge lines by. ``region_px`` (x, y, width, height) keeps only that part
    of the picture and solves spectra there alone; depth and the check of the model use all of it.
    ``band_rows`` is the most rows of the picture whose frames are in memory at once; None: as memory allows.
    """

    grid: WavelengthGrid = field(default_factory=WavelengthGrid)
    correspondence: str = "auto"
    refine_columns: bool = True
    spectra: bool = True
    device: str = "cpu"
    surface_window_px: int | None = None
    solver: str = "best"
    as_calibrated: bool = False
    region_px: tuple[int, int, int, int] | None = None
    band_rows: int | None = None

    @property
    def part(self) -> tuple[slice, slice]:
        """Rows and columns of the region, or of all."""
        if self.region_px is None:
            return slice(None), slice(None)
        x, y, width, height = self.region_px
        return slice(y, y + height), slice(x, x + width)
