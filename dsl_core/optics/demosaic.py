"""Bilinear demosaicing as a linear operator, with the variance it implies."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.rig import BayerPattern, colour_sites

if TYPE_CHECKING:
    import torch


@overload
def demosaic(mosaic: NDArray[np.floating], bayer: BayerPattern) -> NDArray[np.floating]: ...
@overload
def demosaic(mosaic: torch.Tensor, bayer: BayerPattern) -> torch.Tensor: ...
def demosaic(
    mosaic: NDArray[np.floating] | torch.Tensor, bayer: BayerPattern
) -> NDArray[np.floating] | torch.Tensor:
    """Three colours at every pixel from a linear mosaic, shape (..., h, w) -> (..., 3, h, w).

    A missing colour is the mean of its two or four nearest samples; a measured one stays as it is.
    The mosaic is mirrored about its edge pixels, which keeps the Bayer phase. Tensors stay on their
    device. A monochrome picture is grey: all three are its own values. Raises `DecodeError` for images
    smaller than 2 x 2.
    """
    return _apply(mosaic, bayer, squared=False)


@overload
def demosaic_variance(variance: NDArray[np.floating], bayer: BayerPattern) -> NDArray[np.floating]: ...
@overload
def demosaic_variance(variance: torch.Tensor, bayer: BayerPattern) -> torch.Tensor: ...
def demosaic_variance(
    variance: NDArray[np.floating] | torch.Tensor, bayer: BayerPattern
) -> NDArray[np.floating] | torch.Tensor:
    """Variance of `demosaic` for independent pixels, shape (..., h, w) -> (..., 3, h, w).

    Infinite variance (no measurement) makes every value it enters infinitely uncertain.
    """
    return _apply(variance, bayer, squared=True)


def _apply(
    mosaic: NDArray[np.floating] | torch.Tensor, bayer: BayerPattern, squared: bool
) -> NDArray[np.floating] | torch.Tensor:
    # Arrays and tensors are indexed and added alike; only making an empty one differs.
    if isinstance(mosaic, np.ndarray):
        return np.asarray(_interpolate(mosaic, np.empty, bayer, squared))
    import torch

    image: torch.Tensor = _interpolate(mosaic, partial(torch.empty, device=mosaic.device), bayer, squared)
    return image


def _interpolate(mosaic: Any, new: Callable[..., Any], bayer: BayerPattern, squared: bool) -> Any:
    if mosaic.ndim < 2 or min(mosaic.shape[-2:]) < 2:
        raise DecodeError(
            f"Demosaicing needs an image of at least 2 x 2 pixels, given {tuple(mosaic.shape)}."
        )
    if bayer == "MONO":
        out = new((*mosaic.shape[:-2], 3, *mosaic.shape[-2:]), dtype=mosaic.dtype)
        out[...] = mosaic[..., None, :, :]
        return out
    out = new((*mosaic.shape[:-2], 3, *mosaic.shape[-2:]), dtype=mosaic.dtype)
    # Squared weights: the mean of two independent values has half their mean variance.
    half = 0.25 if squared else 0.5
    across = new(mosaic.shape, dtype=mosaic.dtype)
    across[..., 1:-1] = (mosaic[..., :-2] + mosaic[..., 2:]) * half
    across[..., 0], across[..., -1] = mosaic[..., 1], mosaic[..., -2]
    down = _mean_of_rows(mosaic, new, half)
    diagonal = _mean_of_rows(across, new, half)
    cross = (across + down) * half
    for colour, y, x in _sites(bayer):
        out[..., colour, y::2, x::2] = mosaic[..., y::2, x::2]
        if colour == 1:
            out[..., 1, y::2, 1 - x :: 2] = cross[..., y::2, 1 - x :: 2]
        else:
            out[..., colour, y::2, 1 - x :: 2] = across[..., y::2, 1 - x :: 2]
            out[..., colour, 1 - y :: 2, x::2] = down[..., 1 - y :: 2, x::2]
            out[..., colour, 1 - y :: 2, 1 - x :: 2] = diagonal[..., 1 - y :: 2, 1 - x :: 2]
    return out


def _mean_of_rows(image: Any, new: Callable[..., Any], half: float) -> Any:
    """Mean of the rows above and below; at the first and last row both are the one there is."""
    result = new(image.shape, dtype=image.dtype)
    result[..., 1:-1, :] = (image[..., :-2, :] + image[..., 2:, :]) * half
    result[..., 0, :], result[..., -1, :] = image[..., 1, :], image[..., -2, :]
    return result


def _sites(bayer: BayerPattern) -> list[tuple[int, int, int]]:
    """Colour, row phase and column phase of the four pixels of a tile."""
    return [(colour, i // 2, i % 2) for i, colour in enumerate(colour_sites(bayer))]
