"""The lens model against OpenCV and against itself."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.optics.pinhole import (
    BLOCK_PX,
    FADE_RADIUS_SQ,
    distort,
    max_radius_sq,
    pixel_rays,
    project,
    rays_at,
    undistort,
)
from dsl_core.simulation.published_rig import published_rig

LENS = published_rig().camera


def test_undistort_inverts_distort_inside_the_image() -> None:
    x, y = np.meshgrid(np.linspace(-0.25, 0.27, 41), np.linspace(-0.17, 0.17, 31))
    there = distort(x, y, LENS.distortion)
    back = undistort(*there, LENS.distortion)
    assert max(np.abs(back[0] - x).max(), np.abs(back[1] - y).max()) < 1e-11
    assert np.abs(there[0] - x).max() > 1e-3


def test_projection_is_that_of_opencv() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform((-120, -90, 500), (120, 90, 900), (200, 3))
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), LENS.matrix, np.array(LENS.distortion))
    column, row = project(LENS, *points.T)
    assert np.abs(np.stack([column, row], 1) - expected[:, 0]).max() < 1e-9


def test_rays_of_pixels_project_back_onto_them() -> None:
    rays = pixel_rays(LENS)
    column, row = project(LENS, *(650.0 * rays))
    rows, columns = np.indices(column.shape)
    assert np.abs(column - columns).max() < 1e-8
    assert np.abs(row - rows).max() < 1e-8


def test_distortion_that_folds_back_is_refused() -> None:
    x = np.linspace(0.0, 2.0, 11)
    with pytest.raises(CalibrationError, match="cannot be inverted"):
        undistort(x, np.zeros_like(x), (-2.0, 0.0, 0.0, 0.0, 0.0))


def test_image_circle_reaches_a_tenth_beyond_the_farthest_corner() -> None:
    x, y, _ = pixel_rays(LENS)
    assert max_radius_sq(LENS) == pytest.approx(1.1**2 * float((x**2 + y**2).max()), rel=1e-9)
    folded = LENS.model_copy(update={"distortion": (-20.0, 0.0, 0.0, 0.0, 0.0)})
    with pytest.raises(CalibrationError, match="cannot be inverted"):
        max_radius_sq(folded)


def test_beyond_the_image_circle_the_radial_factor_fades_into_a_constant() -> None:
    limit, bent = 0.09, (-0.3, 0.1, 0.0, 0.0, 0.5)
    r2 = np.array([0.0899, 0.0901, limit + FADE_RADIUS_SQ, limit + 999 * FADE_RADIUS_SQ, 1e9])
    r = np.sqrt(r2)
    radial = distort(r, 0 * r, bent, limit)[0] / r
    free = distort(r, 0 * r, bent)[0] / r
    assert radial[0] == free[0]
    # Value and slope continue; then half of the change comes within one fading distance, and it ends.
    assert radial[1] == pytest.approx(free[1], abs=1e-8)
    end = radial[-1] - 0.5 * (free[0] + free[1])
    slope = (free[1] - free[0]) / (r2[1] - r2[0])
    assert end == pytest.approx(slope * FADE_RADIUS_SQ, rel=1e-4)
    assert radial[2] == pytest.approx(radial[-1] - end / 2, abs=1e-5)
    assert radial[3] == pytest.approx(radial[-1] - end / 1000, abs=1e-5)


def test_rays_are_shared_and_so_cannot_be_written_to() -> None:
    assert not pixel_rays(LENS).flags.writeable


def test_the_image_circle_is_a_tenth_beyond_the_farthest_corner() -> None:
    lens = LENS.model_copy(update={"distortion": (0.0,) * 5})
    x = max(lens.cx_px, lens.width_px - 1 - lens.cx_px) / lens.fx_px
    y = max(lens.cy_px, lens.height_px - 1 - lens.cy_px) / lens.fy_px
    assert max_radius_sq(lens) == pytest.approx(1.21 * (x * x + y * y))


def test_beyond_the_circle_the_radial_factor_goes_on_with_its_slope_and_levels_off() -> None:
    k1, k2, k3, limit = -0.3, 0.2, -0.1, 0.5
    coefficients = (k1, k2, 0.0, 0.0, k3)

    def factor(radius_sq: float) -> float:
        x = np.array([np.sqrt(radius_sq)])
        return float(distort(x, 0 * x, coefficients, limit)[0][0] / x[0])

    edge = 1 + k1 * limit + k2 * limit**2 + k3 * limit**3
    slope = k1 + 2 * k2 * limit + 3 * k3 * limit**2
    assert factor(0.2) == pytest.approx(1 + k1 * 0.2 + k2 * 0.04 + k3 * 0.008)
    assert factor(limit) == pytest.approx(edge)
    assert (factor(limit + 1e-5) - edge) / 1e-5 == pytest.approx(slope, rel=1e-3)
    assert factor(limit + 0.3) == pytest.approx(edge + slope * 0.15)
    assert factor(1e9) == pytest.approx(edge + slope * 0.3, rel=1e-6)


def test_tangential_distortion_moves_points_across_the_axes() -> None:
    x, y = np.array([0.3]), np.array([0.2])
    u, v = distort(x, y, (0.0, 0.0, 0.01, 0.02, 0.0))
    assert float(u[0]) == pytest.approx(0.3 + 0.01 * 2 * 0.06 + 0.02 * (0.13 + 2 * 0.09))
    assert float(v[0]) == pytest.approx(0.2 + 0.01 * (0.13 + 2 * 0.04) + 0.02 * 2 * 0.06)


@pytest.mark.parametrize("right", [0.2, 0.8])
@pytest.mark.parametrize("low", [0.3, 0.7])
def test_any_corner_may_be_the_farthest(right: float, low: float) -> None:
    middle = {"cx_px": right * (LENS.width_px - 1), "cy_px": low * (LENS.height_px - 1)}
    lens = LENS.model_copy(update={"distortion": (0.0,) * 5, **middle})
    x, y = 0.8 * (LENS.width_px - 1) / lens.fx_px, 0.7 * (LENS.height_px - 1) / lens.fy_px
    assert max_radius_sq(lens) == pytest.approx(1.21 * (x * x + y * y))


def test_rays_of_a_picture_are_those_of_its_places_across_blocks() -> None:
    lens = published_rig().camera.resized(200, 187)
    assert 2 * BLOCK_PX < 200 * 187
    assert 187 % (BLOCK_PX // 200) > 0
    columns, rows = np.meshgrid(np.arange(200.0), np.arange(187.0))
    np.testing.assert_allclose(pixel_rays(lens), rays_at(lens, columns, rows), rtol=0, atol=1e-11)
