"""How wrong spectra are by the model itself, learned from the probed pixels of a scan.

The parameters of `dsl_core.reconstruction.spectral.probing.probe` are fitted cell by cell. What a cell asks
for, less what its noise alone would ask for, times its effect on reflectance is the error that the model has
there; it is stated as a share of reflectance for every cell and band, and added to the deviation of every
pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.spectral.probing.probe import LEADING, PRIOR_STD, Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS
from dsl_core.reconstruction.spectral.probing.probed_pixels import CELLS

Floats = NDArray[np.float64]

#: How many times the square that noise alone would ask for is taken off: of noise nothing should be left.
SURE = 2.0
#: Room for what varies within a cell.
MARGIN = 1.25
#: Chi-square from which residuals are not noise, and how many such pixels say how they hang together.
MISFIT_FROM, FEW = 1.5, 10


@dataclass(frozen=True)
class ModelError:
    """``relative`` (bands, cells down, cells across) is the error of reflectance by the model, as a share.

    ``correlation`` is by how much the residuals of pixels with misfit hang together from line to line: what
    exceeds a chi-square of 1 does not average out as noise does, and counts as many times.
    """

    relative: Floats
    correlation: float = 1.0

    def at(self, rows: NDArray[np.intp], columns: NDArray[np.intp], shape: tuple[int, ...]) -> Floats:
        """The error at pixels (n,) of a picture of a shape, linear between the cells' centres, (bands, n)."""
        down, across = (
            _shares((at + 0.5) / size * count - 0.5, count)
            for at, size, count in zip((rows, columns), shape, CELLS, strict=True)
        )
        shares = (down[:, None] * across[None]).reshape(-1, len(rows))
        return np.asarray(self.relative.reshape(len(self.relative), -1) @ shares)


def _shares(place: Floats, count: int) -> Floats:
    """Share of each node in places (n,) between them, (count, n); those outside are at the outermost."""
    distance = np.abs(np.clip(place, 0, count - 1) - np.arange(count)[:, None])
    return np.asarray(np.maximum(1 - distance, 0))


def model_error(probe: Probe, common: float = 0.0) -> ModelError:
    """The error of the model in each cell; cells without pixels take their neighbours'.

    A ``common`` error of all reflectance is added.
    """
    from scipy.ndimage import gaussian_filter

    cells, bands = CELLS[0] * CELLS[1], probe.reflectance.shape[1]
    squares, level = np.zeros((cells, bands)), np.zeros((cells, bands))
    for cell in np.unique(probe.cell[probe.sound]):
        here = probe.sound & (probe.cell == cell)
        w = probe.weight[here]
        information = np.tensordot(w, probe.normal[here], 1)[:LEADING, :LEADING]
        covariance = np.linalg.inv(information + np.diag(np.square(1 / np.array(PRIOR_STD[:LEADING]))))
        asked = covariance @ (w @ probe.score[here])[:LEADING]
        # Noise alone asks for as much as the data know of the parameters.
        by_noise = covariance @ information @ covariance
        bias = probe.bias[here][:, :, :LEADING]
        square = (bias @ asked) ** 2 - SURE * np.einsum("nbp,pq,nbq->nb", bias, by_noise, bias)
        if probe.lines is not None:
            square += (bias[:, :, _PROFILE] @ probe.lines.values) ** 2
        squares[cell], level[cell] = square.sum(0), (probe.reflectance[here] ** 2).sum(0)
    error, light = (
        gaussian_filter(values.reshape(*CELLS, bands), (0.7, 0.7, 1.0), mode="nearest")
        for values in (squares, level)
    )
    relative = np.hypot(MARGIN * np.sqrt(np.maximum(error, 0) / np.maximum(light, 1e-6)), common)
    misfit = (probe.chi_square > MISFIT_FROM) & np.isfinite(probe.correlation)
    correlation = float(np.median(probe.correlation[misfit])) if misfit.sum() >= FEW else 1.0
    return ModelError(relative.transpose(2, 0, 1), correlation)


def neighbour_contrast(amplitude: NDArray[np.float32]) -> NDArray[np.float32]:
    """How far the level of a pixel (rows, columns) may be off that sees its neighbours, relative to its own.

    From samples of one colour around it: half their difference, relative to the darkest.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    light = np.maximum(np.nan_to_num(amplitude), 0)
    # Every other row and column has the same colour.
    like_me = np.zeros((5, 5), bool)
    like_me[::2, ::2] = True
    high, low = (
        choose(light, footprint=like_me, mode="mirror") for choose in (maximum_filter, minimum_filter)
    )
    contrast = (high - low) / np.maximum(2 * low, 0.01 * high + 1e-12)
    return np.asarray(maximum_filter(contrast, 3), np.float32)


#: Where the parameters of the lines' profile are.
_PROFILE = [PARAMETERS.index("blur"), PARAMETERS.index("tail")]
