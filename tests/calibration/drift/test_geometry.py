"""Lenses and pose that moved show as smooth residuals; rounding and noise do not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.calibration.common.plane import TargetPlane
from dsl_core.calibration.common.tiles import tile_of_pixels
from dsl_core.calibration.drift.geometry import LIMIT_PX, Floats, geometry_drift, smooth_part
from dsl_core.errors import CalibrationError
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.shading import Plane
from dsl_core.simulation.published_rig import published_rig

KNOWN = np.ones((104, 160), bool)
ROW, COLUMN = (axis.ravel() for axis in np.mgrid[:104, :160])


def test_the_smooth_part_is_what_a_quadratic_explains() -> None:
    x, y = 2 * COLUMN / 160 - 1, 2 * ROW / 104 - 1
    bend = 0.2 + 0.1 * x - 0.15 * x * y + 0.3 * y**2
    noise = 0.3 * np.random.default_rng(1).standard_normal(bend.size)
    rms, std = smooth_part(bend + noise, KNOWN)
    assert rms == pytest.approx(np.sqrt(np.mean(bend**2)), rel=0.03)
    assert std < 0.01


def test_noise_alone_leaves_no_more_than_its_deviation() -> None:
    rng, left = np.random.default_rng(2), []
    for _ in range(20):
        rms, std = smooth_part(0.3 * rng.standard_normal(KNOWN.size), KNOWN)
        # Six terms of so many pixels hold this much of the noise.
        assert std == pytest.approx(0.3 * np.sqrt(6 / KNOWN.size), rel=0.15)
        left.append(rms / std)
    assert np.mean(np.array(left) < 1) > 0.7


@pytest.mark.parametrize(
    ("off", "name"), [((0.0, 0.4), "row drift"), ((0.4, 0.0), "column drift on a plane")]
)
def test_each_direction_has_a_figure(off: tuple[float, float], name: str) -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(160, 104)})
    plane = Plane(np.array([0.05, 0.1, 1.0]) / 720.0)
    depth = plane.depth_mm(rig)
    column, row = (
        part.numpy().reshape(depth.shape)
        for part in zero_order(rig, torch.arange(depth.size), torch.as_tensor(depth.ravel()))
    )
    figures = geometry_drift(rig, column + off[0], row + off[1], depth, TargetPlane(plane, KNOWN, 0.1))
    by_name = {figure.name: figure for figure in figures}
    assert by_name.pop(name).value == pytest.approx(0.4, abs=1e-6)
    assert all(figure.passed and figure.value < 1e-6 for figure in by_name.values())
    assert all(figure.high == LIMIT_PX and figure.advice for figure in figures)


def tiled(values: Callable[[Floats, Floats], Floats]) -> tuple[Floats, NDArray[np.bool_]]:
    """Residuals of all pixels of a picture of 160 by 120, and where they are known."""
    rows, columns = np.mgrid[:120, :160]
    return values(2 * columns / 160 - 1, 2 * rows / 120 - 1).ravel(), np.ones((120, 160), bool)


def test_what_varies_as_a_quadratic_is_drift_and_its_noise_is_taken_out() -> None:
    def smooth(x: Floats, y: Floats) -> Floats:
        return 0.3 - 0.2 * x + 0.4 * y + 0.5 * x * x - 0.6 * x * y + 0.1 * y * y

    residual, known = tiled(smooth)
    rms, std = smooth_part(residual, known)
    assert rms == pytest.approx(np.sqrt(np.mean(residual**2)), rel=0.05)
    assert std < 0.02


def test_noise_alone_is_no_drift_and_its_deviation_is_that_of_six_terms() -> None:
    tiles = tile_of_pixels((160, 120)).ravel()
    count = np.bincount(tiles)
    known = np.ones((120, 160), bool)
    squares, stated = [], []
    for seed in range(60):
        noise = np.random.default_rng(seed).standard_normal(len(count))
        rms, std = smooth_part(noise[tiles], known)
        squares.append(rms**2)
        stated.append(std**2)
    # One deviation a tile: six of so many terms are left in the smooth part.
    assert np.mean(stated) == pytest.approx(6 / len(count), rel=0.15)
    assert np.mean(squares) < np.mean(stated)


def test_a_tile_counts_from_half_of_its_pixels_on_and_eighteen_are_needed() -> None:
    tiles = tile_of_pixels((160, 120))
    number = np.unique(tiles)
    known = np.isin(tiles, number[:18])
    assert smooth_part(np.zeros(int(known.sum())), known) == (0.0, 0.0)
    few = np.isin(tiles, number[:17])
    with pytest.raises(CalibrationError, match="only 17 tiles"):
        smooth_part(np.zeros(int(few.sum())), few)
    place = np.argwhere(tiles == number[17])
    half = known.copy()
    half[tuple(place[: len(place) // 2 - 1].T)] = False
    assert smooth_part(np.zeros(int(half.sum())), half) == (0.0, 0.0)
    half[tuple(place[: len(place) // 2 + 2].T)] = False
    with pytest.raises(CalibrationError, match="only 17 tiles"):
        smooth_part(np.zeros(int(half.sum())), half)


def test_the_smooth_part_is_a_quadratic_and_its_deviation_what_six_terms_keep_of_noise() -> None:
    known = np.ones((32, 48), bool)
    y, x = np.mgrid[:32, :48]
    across, down = 2 * x / 48 - 1, 2 * y / 32 - 1
    course = 0.3 - 0.2 * across + 0.1 * down + 0.4 * across**2 - 0.3 * across * down + 0.2 * down**2
    tiles = 8 * 12

    def mean(values: np.ndarray) -> np.ndarray:
        return np.asarray(values.reshape(8, 4, 12, 4).mean((1, 3)).ravel())

    noise = np.random.default_rng(1).normal(0, 0.2, (32, 48))
    value, one = mean(course + noise), np.ones(tiles)
    a, b = mean(across), mean(down)
    basis = np.stack([one, a, b, a * a, a * b, b * b], 1)
    smooth = basis @ np.linalg.lstsq(basis, value, rcond=None)[0]
    left = 6 * ((value - smooth) ** 2).sum() / (tiles - 6) / tiles
    rms, std = smooth_part((course + noise).ravel(), known)
    assert std == pytest.approx(np.sqrt(left))
    assert rms == pytest.approx(np.sqrt((smooth**2).mean() - left))
    assert smooth_part(0 * noise.ravel(), known) == (0.0, 0.0)


@pytest.mark.parametrize(("tiles", "enough"), [(18, True), (17, False)])
def test_eighteen_tiles_of_which_half_is_known_are_needed(tiles: int, enough: bool) -> None:
    known = np.zeros((32, 48), bool)
    for tile in range(tiles):
        row, column = divmod(tile, 6)
        known[4 * row : 4 * row + 2, 4 * column : 4 * column + 4] = True
    # Less than half of a tile is none.
    known[20, 20:23] = True
    values = np.zeros(int(known.sum()))
    if enough:
        assert smooth_part(values, known) == (0.0, 0.0)
    else:
        with pytest.raises(CalibrationError, match="fills only 17 tiles"):
            smooth_part(values, known)
