"""What an order of the film brings of each material to each colour of the camera, summed over wavelengths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.spectra import chain_response

if TYPE_CHECKING:
    import torch
    from torch import Tensor

NM = np.arange(400.0, 701.0)
#: Orders of the film besides the zero order.
ORDERS = (1, -1, 2, -2)


class Slicing(NamedTuple):
    """Width of the spectral slices of patterns that are not lines, nm; another where they vary both ways.

    Slices whose signal is below the share ``floor`` of the strongest are left out.
    """

    nm: int
    rows_nm: int
    floor: float


#: A bandpass filter passes so few slices that they can be narrow.
BROAD, NARROW = Slicing(10, 25, 1e-3), Slicing(2, 5, 1e-5)


@dataclass(frozen=True)
class Slices:
    """Light of every slice and LED, taken as linear in a slice, both (slices, LEDs, materials * 3).

    ``mean`` times a pattern's mean, plus ``tilt`` times the mean of pattern and place, -1 to 1, is its light.
    """

    mean: Tensor
    tilt: Tensor

    @classmethod
    def make(cls, density: NDArray[np.float64], step: int, device: torch.device) -> Slices:
        """Slices of a width (nm) of densities (materials, 3, LEDs, len(NM))."""
        weight = np.ones(step + 1)
        weight[[0, -1]] = 0.5
        windows = np.lib.stride_tricks.sliding_window_view(density, step + 1, axis=-1)[..., ::step, :]
        place = np.linspace(-1, 1, step + 1)
        # The line with the same light and the same first moment: the place's own mean square is about 1/3.
        moments = (windows @ weight, windows @ (weight * place) * (step / (weight @ place**2)))
        mean, tilt = (np.moveaxis(m, [3, 2], [0, 1]).reshape(m.shape[3], 3, -1) for m in moments)
        return cls(_tensor(mean, device), _tensor(tilt, device))


@dataclass(frozen=True)
class SpectralTables:
    """Spectra of one order, by materials * 3 colours of the camera.

    ``cumulative`` (materials * 3 * len(NM), 2) is the signal of all LEDs up to each wavelength, blurred, and
    its forward difference; ``slices``, by width (nm), that of pieces of the spectrum.
    """

    cumulative: Tensor
    slices: dict[int, Slices]

    @classmethod
    def make(
        cls,
        rig: Rig,
        order: int,
        reflectance: NDArray[np.float64],
        sigma_nm: float,
        slicing: Slicing,
        device: torch.device,
    ) -> SpectralTables:
        """Tables for reflectances (materials, len(NM)); ``sigma_nm`` blurs the lines' spectra."""
        density = chain_response(rig, order, NM)[None] * reflectance[:, None, None]
        slices = {step: Slices.make(density, step, device) for step in slicing[:2]}
        return cls(_tensor(_cumulative(density.sum(2), sigma_nm), device), slices)


def zero_table(rig: Rig, reflectance: NDArray[np.float64], device: torch.device) -> Tensor:
    """Zero-order signal of each LED, (LEDs, materials * 3)."""
    zero = (chain_response(rig, 0, NM)[None] * reflectance[:, None, None]).sum(-1)
    return _tensor(np.moveaxis(zero, 2, 0).reshape(3, -1), device)


def _cumulative(density: NDArray[np.float64], sigma_nm: float) -> NDArray[np.float64]:
    """Blurred cumulative signal over wavelength and its difference, (materials * 3 * nm, 2)."""
    from scipy.ndimage import gaussian_filter1d

    blurred = gaussian_filter1d(density, sigma_nm, axis=-1, mode="nearest")
    total = np.concatenate(
        [np.zeros((*blurred.shape[:2], 1)), np.cumsum((blurred[..., 1:] + blurred[..., :-1]) / 2, -1)], -1
    )
    difference = np.diff(total, axis=-1, append=total[..., -1:])
    return np.stack([total, difference], -1).reshape(-1, 2)


def _tensor(array: NDArray[Any], device: torch.device) -> Tensor:
    import torch

    return torch.as_tensor(np.ascontiguousarray(array), device=device, dtype=torch.float32)
