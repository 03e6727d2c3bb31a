"""Columns of first orders are found below a hundredth of a pixel, from a film that is known roughly."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dsl_core.calibration.film import order_columns
from dsl_core.calibration.film.order_columns import (
    TileColumns,
    _fit_tiles,
    fit_columns,
    search_columns,
    search_px,
)
from dsl_core.calibration.film.order_paths import LineFrames, trace_paths
from dsl_core.optics.correspondence import GratingModel
from tests.cases.order_lines import TRUE_FILM, line_frames, passband, plane_at, rig_with

PLANE = plane_at(700.0)
TRUTH = rig_with(TRUE_FILM)


def true_columns(found: TileColumns) -> np.ndarray:
    """Columns of the true film at the pixels and the wavelength of what was found."""
    depth = PLANE.depth_mm(TRUTH).ravel()[found.pixels]
    assert found.depth_mm == pytest.approx(depth)
    paths = trace_paths(TRUTH, PLANE, found.pixels, passband(TRUTH, 540.0, found.order), GratingModel(TRUTH))
    assert len(paths.at) == len(found)
    return paths.column_px


@pytest.mark.parametrize("order", [1, -1])
def test_fits_from_a_few_columns_off_are_within_their_deviations(order: int) -> None:
    rig = rig_with(TRUE_FILM.model_copy(update={"tilt_y_deg": -0.2, "lines_per_mm": 495.5}))
    frames = line_frames(TRUTH, PLANE, 540.0)
    found = fit_columns(rig, PLANE, frames, passband(rig, 540.0, order), GratingModel(rig))
    before = trace_paths(rig, PLANE, found.pixels, passband(rig, 540.0, order), GratingModel(rig)).column_px
    error = found.column_px - true_columns(found)
    assert np.abs(np.median(before - true_columns(found))) > 0.5
    assert len(found) > 80
    assert np.sqrt(np.mean(error**2)) < 0.05
    # Where tiles are small, the model's own course over them adds to the noise.
    assert 0.4 < np.sqrt(np.median((error / found.std_px) ** 2)) < 1.6


def test_what_the_model_does_not_explain_makes_columns_less_sure() -> None:
    frames = line_frames(TRUTH, PLANE, 540.0)
    rng = np.random.default_rng(5)
    noise = 4 * frames.std * rng.standard_normal(frames.std.shape).astype(np.float32)
    rough = replace(frames, radiance=frames.radiance + noise)
    calm, wild = (
        fit_columns(TRUTH, PLANE, each, passband(TRUTH, 540.0, 1), GratingModel(TRUTH))
        for each in (frames, rough)
    )
    # Noise four times as strong as stated, besides the stated one.
    assert np.median(wild.std_px) / np.median(calm.std_px) > 1.5
    error = wild.column_px - true_columns(wild)
    assert 0.4 < np.sqrt(np.median((error / wild.std_px) ** 2)) < 1.6


def test_a_search_comes_near_from_twenty_columns_off() -> None:
    rig = rig_with(TRUE_FILM.model_copy(update={"lines_per_mm": 546.0}))
    frames = line_frames(TRUTH, PLANE, 540.0)
    found = search_columns(rig, PLANE, frames, passband(rig, 540.0, 1), GratingModel(rig))
    before = trace_paths(rig, PLANE, found.pixels, passband(rig, 540.0, 1), GratingModel(rig)).column_px
    assert np.abs(before - true_columns(found)).min() > 15
    assert len(found) > 50
    assert np.median(np.abs(found.column_px - true_columns(found))) < 1.5


def test_tiles_without_light_are_left_out() -> None:
    frames = line_frames(TRUTH, PLANE, 540.0)
    frames.radiance[:, : 112 * 36] = 0.02 + 0.01 * np.random.default_rng(1).standard_normal((128, 112 * 36))
    for find in (fit_columns, search_columns):
        found = find(TRUTH, PLANE, frames, passband(TRUTH, 540.0, 1), GratingModel(TRUTH))
        assert len(found) > 30
        assert (found.pixels >= 112 * 36).mean() > 0.97


def tile_data(seed: int = 3) -> tuple[np.ndarray, ...]:
    """Three tiles of forty values; the second has no blue, and no value of the last tells of a shift."""
    rng = np.random.default_rng(seed)
    tiles = np.repeat([0, 1, 2], 40)
    colour = rng.integers(0, 3, 120)
    colour[(tiles == 1) & (colour == 2)] = 0
    along = rng.standard_normal(120) * (tiles < 2)
    return tiles, colour, rng.random(120), along, rng.standard_normal(120), 0.5 + rng.random(120)


def test_tiles_are_weighted_least_squares_of_three_lights_a_dark_signal_and_a_shift() -> None:
    tiles, colour, g, along, y, weight = tile_data()
    found = _fit_tiles(tiles, 3, colour, g, along, y, weight)
    for tile in range(3):
        mine = tiles == tile
        design = np.stack([*(g * (colour == c) for c in range(3)), np.ones(120), along], 1)[mine]
        used = (design != 0).any(0)
        normal = design[:, used].T @ (weight[mine, None] * design[:, used])
        values = np.linalg.solve(normal, design[:, used].T @ (weight * y)[mine])
        assert found.values[tile, used] == pytest.approx(values, rel=1e-6, abs=1e-7)
        assert found.values[tile, ~used] == pytest.approx(np.zeros(np.count_nonzero(~used)))
        assert found.std[tile, used] == pytest.approx(np.sqrt(np.diag(np.linalg.inv(normal))), rel=1e-6)
        left = y[mine] - design[:, used] @ values
        assert found.chi_square[tile] == pytest.approx(float((weight[mine] * left**2).sum() / 35))


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_tiles_are_fitted_alike_whatever_the_unit_of_light(scale: float) -> None:
    tiles, colour, g, along, y, weight = tile_data()
    one = _fit_tiles(tiles, 3, colour, g, along, y, weight)
    other = _fit_tiles(tiles, 3, colour, scale * g, scale * along, scale * y, weight / scale**2)
    assert other.values[:, [0, 1, 4]] == pytest.approx(one.values[:, [0, 1, 4]], rel=1e-5, abs=1e-6)
    assert other.values[:, 3] == pytest.approx(scale * one.values[:, 3], rel=1e-5)
    assert other.std[:2, 4] == pytest.approx(one.std[:2, 4], rel=1e-5)


def test_columns_that_are_unsure_by_a_pixel_or_still_move_are_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    frames = line_frames(TRUTH, PLANE, 540.0)
    band, model = passband(TRUTH, 540.0, 1), GratingModel(TRUTH)
    every = fit_columns(TRUTH, PLANE, frames, band, model)
    fit = order_columns._fit_tiles

    def changed(tile: int, **to: tuple[int, float]) -> TileColumns:
        def of_tile(*parts: Any) -> Any:
            found = fit(*parts)
            for name, (column, value) in to.items():
                getattr(found, name)[tile, column] = value
            return found

        with monkeypatch.context() as patch:
            patch.setattr(order_columns, "_fit_tiles", of_tile)
            return fit_columns(TRUTH, PLANE, frames, band, model)

    tile = int(every.tiles[20])
    chi = float(fit_chi(fit, frames, band, tile))
    for left_out, to in (
        (False, {"std": (4, 0.99 / chi)}), (True, {"std": (4, 1.01 / chi)}), (True, {"std": (4, 0.0)}),
        (False, {"values": (4, 0.19)}), (True, {"values": (4, 0.21)}), (True, {"values": (4, -0.21)}),
    ):  # fmt: skip
        assert (tile in changed(tile, **to).tiles) != left_out, to


def fit_chi(fit: Any, frames: LineFrames, band: Any, tile: int) -> float:
    """The root of a tile's chi-square in the last round of its fit, at least one."""
    seen = list[float]()

    def noted(*parts: Any) -> Any:
        found = fit(*parts)
        seen.append(float(found.chi_square[tile]))
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(order_columns, "_fit_tiles", noted)
        fit_columns(TRUTH, PLANE, frames, band, GratingModel(TRUTH))
    assert len(seen) == 5
    return float(np.sqrt(max(seen[-1], 1.0)))


def test_a_search_reaches_as_far_on_a_projector_of_many_columns() -> None:
    """A film unlike its data sheet moves orders by an angle, which is three times the columns there."""
    lens = TRUTH.projector
    many = TRUTH.model_copy(update={"projector": lens.resized(3 * lens.width_px, 3 * lens.height_px)})
    assert many.projector.fx_px == pytest.approx(3 * lens.fx_px)
    assert search_px(TRUTH) == (40.0, 60.0)
    assert search_px(many) == (120.0, 180.0)
