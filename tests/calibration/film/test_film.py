"""Film, residual and hybrid model on columns of a known film: exact, noisy, or bent by an uneven film."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import tile_of_pixels
from dsl_core.calibration.film.correspondence import fit_stage_grid
from dsl_core.calibration.film.fit import COMMON_PX, FIELDS, OrderSamples, fit_film, grating_columns
from dsl_core.calibration.film.order_columns import TileColumns
from dsl_core.calibration.film.residual import choose_residual, correction_px, fit_residual
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Film, Rig
from dsl_core.optics.correspondence import GratingModel, HybridModel, correspondence
from dsl_core.simulation.published_rig import published_rig

SIZE = (222, 145)
DEPTHS_MM, FILTERS_NM = (600.0, 750.0, 900.0), (450.0, 540.0, 640.0)
POSITIONS = [f"position {z:g} mm" for z in DEPTHS_MM]
NAMES = [f"filter {nm:g} nm" for nm in FILTERS_NM]
NOISE_PX = 0.01
Bend = Callable[[NDArray[np.float64], NDArray[np.float64], float, float], NDArray[np.float64]]


def small_rig() -> Rig:
    rig = published_rig()
    film = Film(
        distance_mm=28.2, lines_per_mm=487.0, tilt_x_deg=0.3, tilt_y_deg=-0.5, roll_deg=0.2, bend_per_mm=0.003
    )
    return rig.model_copy(update={"camera": rig.camera.resized(*SIZE), "film": film})


def unbent(x: NDArray[np.float64], y: NDArray[np.float64], depth_mm: float, nm: float) -> NDArray[np.float64]:
    return np.zeros_like(x)


def saddle(x: NDArray[np.float64], y: NDArray[np.float64], depth_mm: float, nm: float) -> NDArray[np.float64]:
    """A smooth error (px) of an uneven film; x and y in -1..1."""
    return 0.4 * x * y - 0.3 * y**2 + 0.1 * x * (nm - 545) / 115


def samples_of(rig: Rig, noise_px: float, bend: Bend = unbent, seed: int = 0) -> OrderSamples:
    """One sample a tile, order, position and filter, where light comes from inside the frame."""
    rng = np.random.default_rng(seed)
    width, height = SIZE
    grid = np.add.outer(np.arange(2, height, 5) * width, np.arange(2, width, 5)).ravel()
    tiles = tile_of_pixels(SIZE).ravel()
    parts = []
    for position, z in enumerate(DEPTHS_MM):
        for name, nm in enumerate(FILTERS_NM):
            for order in (1, -1):
                seen = GratingModel(rig).exact(
                    torch.as_tensor(grid), torch.full((len(grid),), z).double(), order, np.array([nm])
                )
                inside = seen.inside(640, 360)[0].numpy()
                pixels = grid[inside]
                v, u = np.divmod(pixels, width)
                error = bend(2 * u / width - 1, 2 * v / height - 1, z, nm)
                columns = seen.columns[0].numpy()[inside] + order * error
                columns += noise_px * rng.standard_normal(len(pixels))
                std = np.full(len(pixels), max(noise_px, 1e-4))
                depth = np.full(len(pixels), z)
                parts.append(
                    (position, name, TileColumns(order, nm, tiles[pixels], pixels, depth, columns, std))
                )
    return OrderSamples.of(parts)


def mounted(rig: Rig) -> Rig:
    """What the mounting says of the film."""
    return rig.model_copy(update={"film": Film()})


def test_exact_columns_give_the_exact_film() -> None:
    rig = small_rig()
    found = fit_film(mounted(rig), samples_of(rig, 0.0), Film()).film
    # The mounting's prior pulls by less than a thousandth of a pixel.
    samples = samples_of(rig, 0.0)
    again = grating_columns(rig.model_copy(update={"film": found}), samples)
    assert np.abs(again - samples.column_px).max() < 1e-3
    assert found.lines_per_mm == pytest.approx(487.0, abs=0.01)
    assert found.roll_deg == pytest.approx(0.2, abs=0.005)


@pytest.mark.parametrize("seed", range(3))
def test_stated_deviations_cover_the_film(seed: int) -> None:
    rig = small_rig()
    samples = samples_of(rig, NOISE_PX, seed=seed)
    draw, off = np.random.default_rng(100 + seed), np.zeros(len(samples))
    for name, order in np.ndindex(samples.filter.max() + 1, 2):
        mine = (samples.filter == name) & (samples.order == 2 * order - 1)
        across = samples.pixel % rig.camera.width_px / rig.camera.width_px
        off += mine * COMMON_PX * (draw.normal() + draw.normal() * np.sqrt(12) * (across - 0.5))
    fit = fit_film(mounted(rig), replace(samples, column_px=samples.column_px + off), Film())
    errors = np.array([getattr(fit.film, name) - getattr(rig.film, name) for name in FIELDS])
    whitened = errors @ np.linalg.inv(fit.covariance) @ errors
    assert 0.3 < whitened < 20  # chi-square of six numbers


def test_a_fifth_of_wrong_samples_does_no_harm() -> None:
    rig, samples = small_rig(), samples_of(small_rig(), NOISE_PX)
    samples.column_px[::5] += 15.0
    found = rig.model_copy(update={"film": fit_film(mounted(rig), samples, Film()).film})
    off = grating_columns(found, samples) - grating_columns(rig, samples)
    assert np.sqrt(np.mean(off**2)) < 0.02


def test_no_correction_is_chosen_where_the_film_is_enough() -> None:
    rig = small_rig()
    residual, held_out = choose_residual(rig, samples_of(rig, NOISE_PX), POSITIONS, NAMES)
    assert residual.degrees == ()
    assert [each.kept_out for each in held_out] == [*POSITIONS, *NAMES, "a third of the tiles"]
    assert all(each.hybrid_px < 1.2 * NOISE_PX for each in held_out)


def test_an_uneven_film_is_corrected_where_nothing_was_seen() -> None:
    rig = small_rig()
    samples = samples_of(rig, NOISE_PX, saddle)
    film = fit_film(mounted(rig), samples, Film()).film
    fitted = rig.model_copy(update={"film": film})
    residual, held_out = choose_residual(fitted, samples, POSITIONS, NAMES)
    assert residual.degrees
    assert all(each.grating_px > 0.06 for each in held_out)
    assert all(each.hybrid_px < 0.03 for each in held_out)
    assert len(residual.model_dump_json()) < 20_000


def test_hybrid_model_adds_the_correction() -> None:
    rig, samples = small_rig(), samples_of(small_rig(), NOISE_PX, saddle)
    hybrid = rig.model_copy(update={"residual": fit_residual(rig, samples, 2)})
    model = correspondence(hybrid)
    assert isinstance(model, HybridModel)
    part = samples.only((samples.order == 1) & (samples.filter == 1))
    pixels, depth = torch.as_tensor(part.pixel), torch.as_tensor(part.depth_mm)
    wavelengths = np.array([440.0, 540.0, 655.0])
    exact, traced = (
        call(pixels, depth, 1, wavelengths).columns.numpy() for call in (model.exact, model.trace)
    )
    np.testing.assert_allclose(traced, exact, atol=2e-3)
    assert hybrid.residual is not None
    expected = grating_columns(rig, part) + correction_px(rig, hybrid.residual, part)
    np.testing.assert_allclose(exact[1], expected, atol=1e-9)
    assert np.abs(exact[1] - part.column_px).max() < 6 * NOISE_PX
    # The zero order has nothing to correct.
    zero = model.trace(pixels, depth, 0, wavelengths).columns
    np.testing.assert_allclose(zero, GratingModel(rig).trace(pixels, depth, 0, wavelengths).columns)


def test_grid_of_the_seed_follows_from_the_same_samples() -> None:
    rig = small_rig()
    samples = one_a_tile(samples_of(rig, 0.0))
    fit = fit_stage_grid(rig, samples)
    assert fit.grid.depth_range_mm == (600.0, 900.0)
    model = correspondence(rig.model_copy(update={"correspondence": fit.grid}), "grid")
    part = samples.only((samples.order == -1) & (samples.filter == 1) & (samples.position == 1))
    pixels, depth = torch.as_tensor(part.pixel), torch.as_tensor(part.depth_mm)
    columns = model.trace(pixels, depth, -1, np.array([540.0])).columns[0].numpy()
    assert fit.rms_px < 0.002
    # Half of the nodes are reached by fewer than three depths; what is extrapolated there bends the splines.
    assert np.median(np.abs(columns - part.column_px)) < 0.1
    assert len(fit.grid.model_dump_json()) < 1_000_000


def one_a_tile(samples: OrderSamples) -> OrderSamples:
    """The first sample of each tile of each capture."""
    keys = np.stack([samples.position, samples.filter, samples.order, samples.tile], 1)
    first = np.zeros(len(samples), bool)
    first[np.unique(keys, axis=0, return_index=True)[1]] = True
    return samples.only(first)


def test_hybrid_model_needs_a_residual() -> None:
    with pytest.raises(CalibrationError, match="holds no residual"):
        correspondence(small_rig(), "hybrid")


def test_too_few_samples_are_refused() -> None:
    samples = samples_of(small_rig(), NOISE_PX)
    with pytest.raises(CalibrationError, match="found in only 50 tiles"):
        fit_film(small_rig(), samples.only(np.arange(len(samples)) < 50), Film())
