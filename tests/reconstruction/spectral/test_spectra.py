"""How a scan is cut into tiles, and where their spectra go."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from dsl_core.model.result import Reach
from dsl_core.optics.correspondence import Footprint
from dsl_core.optics.pixel_model import COLOUR_ERROR
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.solution import Spectra
from dsl_core.reconstruction.spectral.spectra import (
    LEAST_TILE,
    TILE,
    SpectralReconstruction,
    _wanted,
    blurred_mask,
    tile_shape,
)
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps

BANDS = 4


def test_tiles_shrink_with_the_bands_so_that_memory_stays() -> None:
    assert tile_shape(51) == TILE
    for bands in (61, 120, 231, 465):
        rows, columns = tile_shape(bands)
        assert LEAST_TILE[0] <= rows < TILE[0]
        assert LEAST_TILE[1] <= columns < TILE[1]
        assert rows % 2 == columns % 2 == 0, "the Bayer phase would change from tile to tile"
    assert tile_shape(465) == LEAST_TILE


@pytest.mark.parametrize(("width", "blur_px"), [(900, 10.0), (360, 4.0), (60, 1.0)])
def test_masks_are_as_soft_as_a_ninetieth_of_the_picture_and_at_least_a_pixel(
    width: int, blur_px: float
) -> None:
    mask = np.zeros((12, width), np.float32)
    mask[:, width // 2 :] = 1
    edge = np.diff(blurred_mask(mask)[6])
    x = np.arange(width - 1) + 1 - width // 2
    assert edge.sum() == pytest.approx(1, abs=1e-5)
    assert edge @ x == pytest.approx(0, abs=1e-3)
    assert np.sqrt(edge @ x**2) == pytest.approx(blur_px, rel=0.03)


def test_tiles_of_a_part_of_the_picture_are_those_that_reach_into_it() -> None:
    shape, tile = (100, 200), (slice(10, 20), slice(50, 60))
    everything = slice(None)
    assert _wanted(tile, (everything, everything), shape)
    rows = ((slice(20, 30), False), (slice(19, 30), True), (slice(0, 10), False), (slice(0, 11), True))
    for part, wanted in rows:
        assert _wanted(tile, (part, everything), shape) == wanted
    for part, wanted in ((slice(60, None), False), (slice(59, 61), True), (slice(0, -150), False)):
        assert _wanted(tile, (everything, part), shape) == wanted
    assert not _wanted(tile, (slice(0, 5), slice(0, 5)), shape)


@pytest.mark.parametrize(
    ("bands", "shape"), [(60, (64, 96)), (61, (62, 94)), (120, (32, 48)), (90, (42, 64)), (240, (16, 24))]
)
def test_a_tile_has_even_sides_in_proportion_to_its_bands(bands: int, shape: tuple[int, int]) -> None:
    assert tile_shape(bands) == shape


def stored(misfit: list[float], error: Any = None, **more: Any) -> SpectralMaps:
    """What becomes of four pixels of the second row of a picture, of which two bands of four are reported."""
    spectra = Spectra.empty(torch.zeros((BANDS, 4), dtype=torch.float64))
    spectra.mean[:] = torch.as_tensor(MEAN)
    spectra.std[:], spectra.nodes[:], spectra.data_share[:] = 0.02, 0.3, 0.9
    for name, (place, value) in more.items():
        getattr(spectra, name)[place] = value
    inside = {1: [[1, 1, 0, 0]] * BANDS, -1: [[1, 0, 1, 0]] * BANDS}
    contrast = np.zeros((3, 5), np.float32)
    contrast[1, 1:5] = 0.4
    relative = torch.tensor([0.0, 0.1, float("nan"), 0.0], dtype=torch.float64)
    bands = SimpleNamespace(reported=slice(1, 3), centres_nm=np.arange(BANDS))
    owner: Any = SimpleNamespace(
        bands=bands, error=error, prior=Prior(), contrast=contrast,
        pixels=SimpleNamespace(valid=np.ones((3, 5), bool)), _unsure_level=0.0,
        model=SimpleNamespace(bands=bands, reaches=lambda order, footprint, nm: footprint.columns > 0),
        _map=lambda values, flat: torch.as_tensor(values.ravel()[flat]).double(),
    )  # fmt: skip
    frames: Any = SimpleNamespace(
        flat=np.arange(6, 10), known=lambda name: relative, place=lambda: (np.full(4, 1), np.arange(1, 5))
    )
    out = SpectralMaps.empty(2, (2, 5))
    # The light is that of six pixels, of which the four are the last, in another order.
    columns = {order: torch.tensor(each)[:, [1, 0, 3, 2]] for order, each in inside.items()}
    beside = torch.ones((BANDS, 2), dtype=torch.int64)
    orders = {order: torch.cat([beside, each], 1) for order, each in columns.items()}
    traced: Any = SimpleNamespace(orders={order: Footprint(each, each) for order, each in orders.items()})
    chi_square = torch.tensor(misfit, dtype=torch.float64)
    own = torch.tensor([3, 2, 5, 4])
    SpectralReconstruction._store(owner, spectra, chi_square, frames, (traced, own), out, 1)
    return out


MEAN = np.array([[0.1, 0.2, 0.3, 0.4]] * BANDS) + 0.1 * np.arange(BANDS)[:, None]


def test_spectra_are_stored_where_they_belong_and_with_the_orders_that_measured_them() -> None:
    out = stored([1.0, 1.0, 1.0, 1.0], at_bound=((1, 2), True))
    assert out.reflectance[:, 0, 1:] == pytest.approx(MEAN[1:3])
    assert np.isnan(out.reflectance[:, 0, 0]).all()
    assert np.isnan(out.reflectance[:, 1]).all()
    assert out.data_share[:, 0, 1:] == pytest.approx(0.9)
    both = int(Reach.PLUS_ONE | Reach.MINUS_ONE)
    one = [both, int(Reach.PLUS_ONE), int(Reach.MINUS_ONE), int(Reach.ZERO_ONLY)]
    assert out.reach[:, 0, 1:].tolist() == [one, one]
    assert out.at_bound[0].tolist() == [False, False, False, True, False]
    assert out.chi_square[0, 1:].tolist() == [1.0] * 4
    assert not stored([1.0] * 4, at_bound=((0, 2), True)).at_bound.any(), "not a band that is reported"


def test_spectra_are_as_unsure_as_shading_misfit_and_mixed_pixels_make_them() -> None:
    mean = MEAN[1:3]
    shading = np.array([0.0, 0.1, 0.0, 0.0])
    out = stored([0.5, 1.0, 2.9, 3.1])
    excess = 0.02 * np.sqrt([1.0, 1.0, 2.9, 3.1])
    mixed = np.where(np.arange(4) == 3, np.minimum(0.4 * mean, 0.5), 0.0)
    assert out.std[:, 0, 1:] == pytest.approx(np.sqrt(excess**2 + (mean * shading) ** 2 + mixed**2), rel=1e-5)
    high = stored([1.0] * 4, nodes=((0, 3), 0.76), at_bound=((0, 3), True))
    assert high.std[:, 0, 4] == pytest.approx(np.hypot(0.02, 0.5 * mean[:, 3]), rel=1e-5)
    low = stored([1.0] * 4, nodes=((0, 3), 0.74), at_bound=((0, 3), True))
    assert low.std[:, 0, 4] == pytest.approx(0.02)
    large = stored([9.0] * 4, mean=((slice(None), 3), 1.6))
    assert large.std[0, 0, 4] == pytest.approx(np.hypot(0.06, 0.5), rel=1e-5), "at most half"


def test_what_is_left_of_the_model_counts_with_misfit_that_neighbouring_lines_share() -> None:
    def at(y: np.ndarray, x: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
        assert (y.tolist(), x.tolist(), shape) == ([1] * 4, [1, 2, 3, 4], (3, 5))
        return np.full((2, 4), 0.2)

    out = stored([1.0, 1.2, 2.3, 2.9], SimpleNamespace(correlation=3.0, at=at))
    excess = 0.02**2 * np.array([1.0, 1.2, 2.3 + 1.0 * 2, 2.9 + 1.6 * 2])
    relative = np.hypot([0.0, 0.1, 0.0, 0.0], 0.2)
    assert out.std[:, 0, 1:] == pytest.approx(np.sqrt(excess + (MEAN[1:3] * relative) ** 2), rel=1e-5)


def test_the_zero_order_says_something_of_the_colour_where_first_orders_are_not_complete() -> None:
    colour = torch.tensor([[2.0], [1.0], [0.5]])
    variance = torch.tensor([[0.01], [0.02], [0.03]])
    frames: Any = SimpleNamespace(flat=np.array([3]), zero_order_colour=lambda: (colour, variance))

    def roots(kappa: float) -> Any:
        owner: Any = SimpleNamespace(
            colour_weight=np.full((2, 3), kappa, np.float32), _map=lambda values, flat: torch.tensor([kappa])
        )
        return SpectralReconstruction._colour_roots(owner, frames)

    assert roots(0.9e-3) is None
    found = roots(0.25)
    assert torch.equal(found[0], colour)
    wanted = (0.25 / (variance + (COLOUR_ERROR * colour) ** 2)).sqrt()
    assert found[1].flatten().tolist() == pytest.approx(wanted.flatten().tolist())
    assert roots(1.1e-3) is not None


def test_the_zero_order_says_the_colour_where_first_orders_do_not_reach_from_the_first_band_to_the_last() -> (
    None
):
    """Of a picture whose left half both ends of the range reach by one order or the other."""
    valid = np.ones((20, 60), bool)
    valid[:, 50:] = False
    asked = list[list[float]]()

    def reached(order: int, flat: torch.Tensor, depth: torch.Tensor, nm: np.ndarray) -> torch.Tensor:
        asked.append(nm.tolist())
        column = flat % 60
        return (
            torch.stack([column < 30, column < 40]) if order == 1 else torch.stack([column >= 90, column < 9])
        )

    owner: Any = SimpleNamespace(
        pixels=SimpleNamespace(valid=valid), model=SimpleNamespace(reached=reached),
        bands=SimpleNamespace(centres_nm=np.array([420.0, 430.0, 440.0, 450.0, 460.0]), reported=slice(1, 4)),
        _pixels_and_depth=lambda flat: (torch.as_tensor(flat), torch.zeros(len(flat))),
    )  # fmt: skip
    weight = SpectralReconstruction._colour_weight(owner)
    assert asked == [[430.0, 450.0]] * 2
    assert weight[10, :25] == pytest.approx(0.0, abs=1e-6)
    assert weight[10, 35:45] == pytest.approx(1.0, abs=1e-6)
    assert weight[10, 55:] == pytest.approx(0.0, abs=1e-6), "what is not measured is not coloured"
