"""Spectra of a picture: cubes and maps that tiles fill."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.spectral.model_error import ModelError
from dsl_core.reconstruction.spectral.self_correction import Followed


@dataclass(frozen=True)
class SpectralMaps:
    """Cubes (bands, rows, columns) of the reported bands, and maps (rows, columns); NaN where invalid.

    ``followed`` is what the scan says about its model, where it can say anything, and the model that spectra
    are those of; ``error`` is what is left.
    """

    reflectance: NDArray[np.float32]
    std: NDArray[np.float32]
    data_share: NDArray[np.float32]
    reach: NDArray[np.uint8]
    at_bound: NDArray[np.bool_]
    chi_square: NDArray[np.float32]
    followed: Followed | None = None
    error: ModelError | None = None

    @classmethod
    def empty(cls, bands: int, shape: tuple[int, int]) -> SpectralMaps:
        """Maps full of NaN, to be filled by tiles."""
        cube = (bands, *shape)
        return cls(
            reflectance=np.full(cube, np.nan, np.float32),
            std=np.full(cube, np.nan, np.float32),
            data_share=np.full(cube, np.nan, np.float32),
            reach=np.zeros(cube, np.uint8),
            at_bound=np.zeros(shape, bool),
            chi_square=np.zeros(shape, np.float32),
        )


def put_pixels(maps: NDArray[Any], flat: NDArray[np.intp], values: NDArray[Any]) -> None:
    """Put values (n, pixels) at flat, rising places of maps (n, rows, columns).

    >>> maps = np.zeros((1, 2, 3), int)
    >>> put_pixels(maps, np.array([1, 2, 4, 5]), np.array([[1, 2, 3, 4]]))
    >>> maps.tolist()
    [[[0, 1, 2], [0, 3, 4]]]
    >>> put_pixels(maps, np.array([0, 2, 3]), np.array([[7, 8, 9]]))
    >>> maps.tolist()
    [[[7, 1, 8], [9, 3, 4]]]
    """
    top, left = divmod(int(flat[0]), maps.shape[-1])
    bottom, right = divmod(int(flat[-1]), maps.shape[-1])
    shape = bottom - top + 1, right - left + 1
    corner = np.arange(left, right + 1) + np.arange(top, bottom + 1)[:, None] * maps.shape[-1]
    if shape[1] > 0 and np.array_equal(flat, corner.ravel()):
        # A whole rectangle takes a tenth of the time that pixels take which are looked up one by one.
        maps[:, top : bottom + 1, left : right + 1] = values.reshape(-1, *shape)
    else:
        maps.reshape(len(maps), -1)[:, flat] = values
