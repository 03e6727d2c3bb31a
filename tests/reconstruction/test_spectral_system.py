"""Banded normal equations of scan lines against the full image model."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.image_formation import ImageFormation, OrderPath
from dsl_core.patterns.images import spectral_profiles
from dsl_core.reconstruction.line_set import LineSet
from dsl_core.reconstruction.spectral.spectra import LEAST_TILE, TILE, tile_shape
from dsl_core.reconstruction.spectral.system import BandedAccumulator, Bands, band_halfwidth_px
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve import banded

PIXELS = 6


@pytest.mark.parametrize("order", [1, -1])
def test_banded_equations_are_those_of_the_full_model(order: int) -> None:
    rig, plan = published_rig(), CapturePlan()
    bands, lines = Bands.of(rig, WavelengthGrid()), LineSet.of(plan)
    assert lines is not None
    # Pixels of the middle row: order +1 reaches the left ones whole, order -1 the right ones, others in part.
    pixels = 290 * 890 + torch.linspace(60, 830, PIXELS).long()
    depth = torch.full((PIXELS,), 700.0, dtype=torch.float64)
    footprint = GratingModel(rig).trace(pixels, depth, order, bands.centroids_nm[order])
    inside = footprint.inside(*plan.projector_size_px)
    assert inside.any()
    assert not inside.all()
    generator = torch.Generator().manual_seed(0)
    radiance, weight = torch.rand(
        (2, 3, plan.spectral_count, PIXELS), generator=generator, dtype=torch.float64
    )
    system = BandedAccumulator(rig, bands, lines, PIXELS, depth)
    system.add(order, footprint.columns, inside, radiance, weight, 0, 0.0)
    half = band_halfwidth_px(footprint.columns, bands.step_nm, bands.centres_nm)
    path = OrderPath(footprint.columns, inside, bands.moments[order], half)
    profiles = spectral_profiles(plan).astype(np.float64)
    model = ImageFormation(rig.projector_response, profiles, [path], torch.ones_like(depth))
    full = model.matrix().reshape(PIXELS, -1, bands.count)
    weighted = full * weight.permute(2, 0, 1).reshape(PIXELS, -1, 1)
    expected = weighted.mT @ full
    found = banded.to_dense(system.matrix)
    assert (found - expected).abs().max() < 0.01 * expected.abs().max()
    right = model.adjoint(radiance * weight)
    assert (system.right - right).abs().max() < 0.01 * right.abs().max()
    assert not system.right[~inside].any()


def test_bands_narrower_than_a_column_leave_the_equations_positive() -> None:
    rig, plan = published_rig(), CapturePlan()
    bands, lines = Bands.of(rig, WavelengthGrid(step_nm=1.0)), LineSet.of(plan)
    assert lines is not None
    pixels = torch.arange(0, 890 * 580, 8009)
    depth = torch.full((len(pixels),), 700.0, dtype=torch.float64)
    bright = torch.full((3, plan.spectral_count, len(pixels)), 1e5, dtype=torch.float64)
    system = BandedAccumulator(rig, bands, lines, len(pixels), depth)
    for order in (1, -1):
        footprint = GratingModel(rig).trace(pixels, depth, order, bands.centroids_nm[order])
        inside = footprint.inside(*plan.projector_size_px)
        system.add(order, footprint.columns, inside, bright, bright, 0, 0.0)
    matrix = system.positive_matrix()
    matrix[0] += 2.8
    assert bool((banded.factorise(matrix).diagonal > 0).all())


def test_tiles_shrink_with_the_bands_so_that_memory_stays() -> None:
    assert tile_shape(51) == TILE
    for bands in (61, 120, 231, 465):
        rows, columns = tile_shape(bands)
        assert LEAST_TILE[0] <= rows < TILE[0]
        assert LEAST_TILE[1] <= columns < TILE[1]
        assert rows % 2 == columns % 2 == 0, "the Bayer phase would change from tile to tile"
    assert tile_shape(465) == LEAST_TILE
