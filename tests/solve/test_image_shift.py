"""Shifts of tiles between pictures made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from dsl_core.solve.image_shift import TileShifts, tile_shifts

NOISE = 2.0


def found(moved: np.ndarray, old: np.ndarray, seed: int = 1) -> TileShifts:
    rng = np.random.default_rng(seed)
    first, second = (each + NOISE * rng.normal(size=old.shape) for each in (old, moved))
    return tile_shifts(first, second, np.full(old.shape, 2 * NOISE**2), (2, 3))


@pytest.fixture
def scene() -> np.ndarray:
    return 200 + 900 * gaussian_filter(np.random.default_rng(7).normal(size=(48, 72)), 2.0)


@pytest.mark.parametrize("by", [(0.0, 0.0), (0.3, -0.2), (1.0, 0.6), (-3.4, 2.2)])
def test_a_shift_of_all_is_measured(scene: np.ndarray, by: tuple[float, float]) -> None:
    moved = 0.9 * shift(scene, by[::-1], order=3, mode="nearest") + 5
    got = found(moved, scene)
    assert np.median(got.x) == pytest.approx(by[0], abs=0.05)
    assert np.median(got.y) == pytest.approx(by[1], abs=0.05)
    assert (np.hypot(got.x - by[0], got.y - by[1]) < 6 * np.hypot(got.x_std, got.y_std) + 0.05)[0, 1]


def test_what_has_not_moved_is_within_its_deviations(scene: np.ndarray) -> None:
    worst = max(found(scene, scene, seed).sigmas.max() for seed in range(10))
    assert worst < 6


def test_a_part_that_moves_is_found_there(scene: np.ndarray) -> None:
    moved = scene.copy()
    moved[:24, :24] = shift(scene, (0, 0.8), order=3, mode="nearest")[:24, :24]
    got = found(moved, scene)
    assert got.length[0, 0] == pytest.approx(0.8, abs=0.1)
    assert np.delete(got.length.ravel(), 0).max() < 0.15


def test_a_shift_explains_what_moved_and_little_of_what_was_sharpened(scene: np.ndarray) -> None:
    moved = found(shift(scene, (0.2, 0.5), order=3, mode="nearest"), scene)
    sharpened = found(scene + 0.5 * (scene - gaussian_filter(scene, 1.0)), scene)
    assert moved.explained.min() > 0.9
    assert sharpened.explained.max() < 0.4


def test_the_gradients_of_noise_tell_nothing() -> None:
    fading = np.tile(np.linspace(150.0, 300.0, 300), (200, 1))
    for seed in range(5):
        got = found(fading, fading, seed)
        assert got.y_std.min() > 0.1, "nothing but noise changes down the picture"
        assert got.sigmas.max() < 6


@pytest.mark.parametrize("stripes", [False, True])
def test_edges_of_noise_are_no_common_shift(stripes: bool) -> None:
    wall = np.full((180, 320), 85.0)
    wall[:, :13] *= 0.6
    if stripes:
        wall *= np.arange(320) % 4 < 2
    for seed in range(8):
        got = found(wall, wall, seed)
        assert got.length.max() < 3
        assert got.change.max() < 0.1


@pytest.mark.parametrize("contrast", [900.0, 60.0])
@pytest.mark.parametrize("by", [(70, -10), (-3, 4)])
def test_far_shifts_are_found_whatever_becomes_of_the_light(by: tuple[int, int], contrast: float) -> None:
    world = 200 + contrast * gaussian_filter(np.random.default_rng(7).normal(size=(240, 400)), 2.0)
    old, moved = (world[30 - y : 210 - y, 75 - x : 325 - x] for x, y in ((0, 0), by))
    got = found(0.8 * moved + 30, old)
    assert (np.median(got.x), np.median(got.y)) == pytest.approx(by, abs=0.15)


def test_an_empty_picture_tells_nothing() -> None:
    flat = np.full((48, 72), 100.0)
    got = tile_shifts(flat, flat, np.ones_like(flat), (2, 3))
    assert np.isinf(got.x_std).all()
    assert not got.sigmas.any()


def test_sigmas_and_lengths_are_those_of_both_directions() -> None:
    one = np.ones((1, 1))
    found = TileShifts(3 * one, -4 * one, 0.5 * one, 2 * one, 0 * one, one, 100 * one, one)
    assert found.length.item() == 5.0
    assert found.sigmas.item() == pytest.approx(np.hypot(6, 2))
    assert replace(found, better=9 * one).sigmas.item() == pytest.approx(3)


def test_a_shift_is_told_by_what_it_explains_better_than_brightness_alone(scene: np.ndarray) -> None:
    moved = found(shift(scene, (0, 0.5), order=3, mode="nearest"), scene)
    assert moved.better.min() > 1000
    assert found(0.8 * scene + 20, scene).better.max() < 36


def test_the_rest_that_nothing_explains_is_told_with_the_gain(scene: np.ndarray) -> None:
    rng = np.random.default_rng(3)
    grain = 30 * rng.normal(size=scene.shape)
    found = tile_shifts(scene, 0.7 * scene + 40 + grain, np.full(scene.shape, 10.0**2), (2, 3))
    assert found.gain == pytest.approx(0.7, rel=0.1)
    tiles = scene.reshape(2, 24, 3, 24).transpose(0, 2, 1, 3)
    wanted = np.sqrt(30.0**2 - 10**2) / (0.7 * np.abs(tiles).mean((2, 3)))
    assert found.change == pytest.approx(wanted, rel=0.12)


def test_deviations_are_those_of_least_squares_on_the_gradient(scene: np.ndarray) -> None:
    found = tile_shifts(scene, scene, np.full(scene.shape, 4.0), (1, 1))
    gy, gx = np.gradient(scene)
    design = np.stack([gx.ravel(), gy.ravel(), scene.ravel(), np.ones(scene.size)], 1)
    std = np.sqrt(4 * np.diag(np.linalg.inv(design.T @ design)))
    assert (found.x_std.item(), found.y_std.item()) == pytest.approx((std[0], std[1]), rel=0.03)
    assert (found.x.item(), found.y.item(), found.gain.item()) == pytest.approx((0, 0, 1), abs=1e-6)


def test_a_tile_is_followed_two_and_a_half_pixels_beyond_the_others(scene: np.ndarray) -> None:
    for by, known in ((2.0, True), (4.0, False)):
        moved = scene.copy()
        moved[:24, :24] = shift(scene, (0, by), order=3, mode="nearest")[:24, :24]
        tile = tile_shifts(scene, moved, np.full(scene.shape, 4.0), (2, 3))
        assert np.isfinite(tile.x_std[0, 0]) == known
        assert tile.x[0, 0] == pytest.approx(by if known else 0.0, abs=0.2)


@pytest.mark.parametrize(("by_px", "told"), [(0.015, False), (0.026, True)])
def test_a_shift_that_matters_to_nobody_explains_nothing(scene: np.ndarray, by_px: float, told: bool) -> None:
    moved = shift(scene, (0, by_px), order=3, mode="nearest")
    got = tile_shifts(scene, moved, np.full(scene.shape, 1e-3), (1, 1))
    assert got.x.item() == pytest.approx(by_px, abs=1e-3)
    assert (got.better.item() > 0) is told
