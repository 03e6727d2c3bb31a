"""Two simpler reconstructions to compare with: the nearest line in closed form, and a basis under colour.

Both take what `SpectralReconstruction` takes and return the same maps, without uncertainty.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.result import Reach
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.charts import chart_reflectance
from dsl_core.optics.demosaic import demosaic
from dsl_core.optics.spectra import hat_moments
from dsl_core.progress import Progress
from dsl_core.reconstruction.spectral.published_objective import LineData, PublishedReconstruction
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps

#: Functions of the basis, as in Li et al., "Pro-Cam SSfM" (ICCV 2019), after Park et al. (ICCV 2007).
BASIS_FUNCTIONS = 8
#: Weight of squared second differences over wavelength against the squared misfit in units of white.
SMOOTHNESS = 1e-3


class NearestLine(PublishedReconstruction):
    """Each band from the one frame whose line is nearest, three colours by least squares, no prior.

    Bands that the chosen order does not reach take the value of the nearest band that it does.
    """

    def fit(self, measured: LineData) -> Tensor:
        """Spectra (bands, pixels), 0 to 1.5."""
        white = measured.first_white
        power = white.square().sum(0).clip(min=1e-12)
        found = (white * measured.first).sum(0) / power
        return _filled(found, measured.reached).clip(0, 1.5)


def _filled(values: Tensor, known: Tensor) -> Tensor:
    """Values (bands, pixels) with unknown bands taken from the nearest known one; 0 where none is."""
    bands = torch.arange(len(values))[:, None]
    distance = (bands - bands.T).abs()[:, :, None] + 10_000 * (~known)[None]
    nearest = distance.argmin(1)
    return torch.where(known.any(0), values.gather(0, nearest), 0.0)


class ColourBasis:
    """Spectra from the zero-order colour alone, by a basis of chart spectra and smoothness.

    In the manner of Pro-Cam SSfM (Li, Qiu, Monno, Tanaka, Okutomi, ICCV 2019), which has seven colours of the
    projector; a scan of white patterns has one, so three numbers a pixel.
    """

    def __init__(self, rig: Rig, grid: WavelengthGrid, pixels: Pixels) -> None:
        self.rig, self.grid, self.pixels = rig, grid, pixels

    def run(self, progress: Progress | None = None) -> SpectralMaps:
        """Solve all valid pixels by one matrix."""
        out = SpectralMaps.empty(self.grid.count, self.pixels.valid.shape)
        flat = np.flatnonzero(self.pixels.valid)
        colour = demosaic(np.nan_to_num(self.pixels.amplitude), self.rig.sensor.bayer).reshape(3, -1)[:, flat]
        moments = hat_moments(self.rig, 0, self.grid.centres_nm, self.grid.step_nm)[0].sum(1)
        unit = moments.sum(1).max()
        values = colour / (self.pixels.shading.ravel()[flat] * unit)
        spectra = basis_solution(moments / unit, chart_basis(self.grid)) @ values
        out.reflectance.reshape(self.grid.count, -1)[:, flat] = spectra.clip(0, 1.5)
        out.reach.reshape(self.grid.count, -1)[:, flat] = int(Reach.ZERO_ONLY)
        if progress is not None:
            progress.report("spectra", 1, 1)
        return out


def chart_basis(grid: WavelengthGrid) -> NDArray[np.float64]:
    """Principal directions (not centred) of a chart's spectra, (bands, functions)."""
    chart = np.stack(list(chart_reflectance(grid.centres_nm, "ISO 17321-1").values()))
    return np.asarray(np.linalg.svd(chart, full_matrices=False)[2][:BASIS_FUNCTIONS].T)


def basis_solution(moments: NDArray[np.float64], basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix (bands, 3) from colours in units of white to spectra: regularised least squares."""
    rough = np.diff(basis, 2, axis=0) * len(basis)
    seen = moments @ basis
    normal = seen.T @ seen + SMOOTHNESS * rough.T @ rough / len(basis)
    return np.asarray(basis @ np.linalg.solve(normal, seen.T))
