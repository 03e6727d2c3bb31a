"""Demosaicing is the linear operator it says it is, edges and variance included."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.demosaic import demosaic, demosaic_variance
from dsl_core.optics.sensor import bayer_channels

PATTERNS: tuple[BayerPattern, ...] = tuple(p for p in get_args(BayerPattern) if p != "MONO")
SIZES = [(6, 8), (5, 7), (2, 2), (3, 2)]


def mosaic_of(image: NDArray[np.float64], bayer: BayerPattern) -> NDArray[np.float64]:
    channels = bayer_channels(bayer, *image.shape[1:])
    return np.asarray(np.take_along_axis(image, channels[None], axis=0)[0])


@pytest.mark.parametrize("bayer", PATTERNS)
@pytest.mark.parametrize("size", SIZES)
def test_constant_colour_is_exact_everywhere(bayer: BayerPattern, size: tuple[int, int]) -> None:
    image = np.broadcast_to(np.array([3.0, -5.0, 11.0])[:, None, None], (3, *size))
    np.testing.assert_array_equal(demosaic(mosaic_of(image, bayer), bayer), image)


@pytest.mark.parametrize("bayer", PATTERNS)
def test_a_ramp_is_exact_inside(bayer: BayerPattern) -> None:
    """A swapped phase or a shift by a pixel would show."""
    y, x = np.indices((9, 10), float)
    image = np.stack([x + 10 * y, 7 - 2 * x + y, 3 * x - 4 * y])
    ours = demosaic(mosaic_of(image, bayer), bayer)
    np.testing.assert_allclose(ours[:, 1:-1, 1:-1], image[:, 1:-1, 1:-1], atol=1e-12)


@pytest.mark.parametrize("bayer", PATTERNS)
@pytest.mark.parametrize("size", SIZES)
def test_variance_is_that_of_the_operator(bayer: BayerPattern, size: tuple[int, int]) -> None:
    count = size[0] * size[1]
    impulses = np.eye(count).reshape(count, *size)
    matrix = demosaic(impulses, bayer).reshape(count, -1)
    variance = np.random.default_rng(1).uniform(0.5, 2, size)
    expected = (matrix**2).T @ variance.ravel()
    np.testing.assert_allclose(demosaic_variance(variance, bayer).ravel(), expected, rtol=1e-12)


def test_an_unmeasured_pixel_spoils_only_what_it_enters() -> None:
    variance = np.ones((6, 6), np.float32)
    variance[2, 2] = np.inf  # a red pixel
    spread = demosaic_variance(variance, "RGGB")
    assert not np.isnan(spread).any()
    red, green, blue = np.isinf(spread)
    assert np.argwhere(red).min(0).tolist() == [1, 1]
    assert np.argwhere(red).max(0).tolist() == [3, 3]
    assert not green.any()
    assert not blue.any()


def test_stacks_tensors_and_precision() -> None:
    stack = np.random.default_rng(2).random((2, 3, 6, 8)).astype(np.float32)
    ours = demosaic(stack, "GBRG")
    assert ours.dtype == np.float32
    assert ours.shape == (2, 3, 3, 6, 8)
    np.testing.assert_array_equal(ours[1, 2], demosaic(stack[1, 2], "GBRG"))
    tensor = demosaic(torch.from_numpy(stack), "GBRG")
    assert isinstance(tensor, torch.Tensor)
    np.testing.assert_array_equal(tensor.numpy(), ours)


def test_gradients_pass_through() -> None:
    mosaic = torch.rand(4, 5, dtype=torch.float64, requires_grad=True)
    weights = torch.rand(3, 4, 5, dtype=torch.float64)
    image = demosaic(mosaic, "GRBG")
    (adjoint,) = torch.autograd.grad((image * weights).sum(), mosaic)
    # <A x, w> = <x, A^T w>
    torch.testing.assert_close((image * weights).sum(), (mosaic * adjoint).sum())


def test_too_small() -> None:
    with pytest.raises(DecodeError, match="at least 2 x 2"):
        demosaic(np.zeros((1, 8)), "RGGB")


def test_a_monochrome_picture_is_grey_and_nothing_is_interpolated() -> None:
    picture = np.random.default_rng(2).uniform(0, 1, (5, 7))
    for operator in (demosaic, demosaic_variance):
        np.testing.assert_array_equal(operator(picture, "MONO"), np.stack([picture] * 3))
