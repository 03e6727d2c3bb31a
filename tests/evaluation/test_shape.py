"""Planes and sections against surfaces that are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.evaluation.shape import fit_plane, section

FOCAL_PX, SHAPE = 500.0, (48, 64)


def _rays() -> NDArray[np.float64]:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.stack([(x - 31.5) / FOCAL_PX, (y - 23.5) / FOCAL_PX, np.ones(SHAPE)])


def _tilted(degrees: float, distance_mm: float = 700.0) -> NDArray[np.float64]:
    """Points of a plane turned about the vertical axis."""
    rays, turn = _rays(), np.radians(degrees)
    return np.asarray(rays * distance_mm / (1 - np.tan(turn) * rays[0]))


def test_a_plane_is_found_with_the_deviation_that_it_states() -> None:
    rng, points = np.random.default_rng(0), _tilted(20.0)
    tilts, stated = [], []
    for _ in range(60):
        std = np.full(SHAPE, 0.3)
        noisy = points * (1 + rng.normal(0, std) / points[2])
        fit = fit_plane(noisy.reshape(3, -1).T, std.ravel())
        assert fit is not None
        tilts.append(fit.tilt_deg)
        stated.append(fit.tilt_std_deg)
        assert fit.rms_mm == pytest.approx(fit.expected_mm, rel=0.1)
    assert np.mean(tilts) == pytest.approx(20.0, abs=4 * np.mean(stated) / 60**0.5)
    assert np.std(tilts) == pytest.approx(np.mean(stated), rel=0.3)


@pytest.mark.parametrize("degrees", [0.0, 0.05, 5.0])
def test_the_band_of_a_tilt_holds_it_also_where_a_plane_faces_the_camera(degrees: float) -> None:
    """Two directions tilt such a plane, and an angle is never below zero."""
    rng, points, inside = np.random.default_rng(3), _tilted(degrees), []
    for _ in range(200):
        noisy = points * (1 + rng.normal(0, 0.3, SHAPE) / points[2])
        fit = fit_plane(noisy[:, ::2, ::2].reshape(3, -1).T, np.full(points[2, ::2, ::2].size, 0.3))
        assert fit is not None
        inside.append(abs(fit.tilt_deg - degrees) <= 1.96 * fit.tilt_std_deg)
    assert np.mean(inside) > 0.91


def test_what_stands_out_does_not_tilt_the_plane() -> None:
    points = _tilted(0.0).reshape(3, -1).T.copy()
    points[:300] *= 0.98
    fit = fit_plane(points + np.random.default_rng(1).normal(0, 0.01, points.shape))
    assert fit is not None
    assert fit.tilt_deg < 0.1
    assert fit.used == pytest.approx(fit.points - 300, abs=40)
    assert fit.offset_mm == pytest.approx(-700, abs=0.1)
    assert fit_plane(points[:3]) is None
    assert fit_plane(np.full((9, 3), np.nan)) is None


@pytest.mark.parametrize("std_mm", [0.0, np.nan])
def test_a_plane_is_found_where_nobody_knows_the_deviations(std_mm: float) -> None:
    points = _tilted(20.0).reshape(3, -1).T
    fit = fit_plane(points, np.full(len(points), std_mm))
    assert fit is not None
    assert fit.used == len(points)
    assert fit.tilt_deg == pytest.approx(20.0)
    assert np.isnan(fit.expected_mm)


def test_a_section_is_as_unknown_as_the_ends_of_its_line() -> None:
    std = np.full(SHAPE, 0.3)
    std[24, 60] = np.nan
    cut = section(_tilted(20.0), std, (4, 24), (60, 24))
    assert cut is not None
    assert np.isnan(cut.std_mm[1:]).all()


def test_a_section_of_a_step_shows_its_height_and_length() -> None:
    rays = _rays()
    depth = np.where((np.arange(64) > 20) & (np.arange(64) < 44), 690.0, 700.0) * np.ones(SHAPE)
    cut = section(rays * depth, np.full(SHAPE, 0.2), (2, 24), (61, 24))
    assert cut is not None
    assert cut.along_mm[0] == 0
    assert cut.along_mm[-1] == pytest.approx(59 * 700 / FOCAL_PX)
    assert cut.height_mm[0] == pytest.approx(0)
    assert cut.height_mm[30] == pytest.approx(10.0, abs=1e-3)


def test_a_section_along_a_step_is_on_either_surface_and_not_between() -> None:
    """The line crosses from one row to the next, over a step of 100 mm between the two."""
    depth = np.where(np.arange(48)[:, None] <= 24, 600.0, 700.0) * np.ones(SHAPE)
    points = _rays() * depth
    cut = section(points, np.full(SHAPE, 0.3), (2, 24), (61, 25))
    assert cut is not None
    first, base = points[:, 24, 2], points[:, 25, 61] - points[:, 24, 2]
    along = base / np.linalg.norm(base)
    across = -first + (first @ along) * along
    across /= np.linalg.norm(across)
    found = first[2] + along[2] * cut.along_mm + across[2] * cut.height_mm
    assert np.minimum(abs(found - 600), abs(found - 700)).max() < 0.01
    slope = points.copy()
    slope[:, 25:] = _rays()[:, 25:] * 600.5
    cut = section(slope, np.full(SHAPE, 0.3), (2, 24), (61, 25))
    assert cut is not None
    assert np.abs(cut.height_mm).max() < 0.05, "what is no step is mixed"


def test_heights_of_a_section_vary_as_stated_with_the_ends_of_its_line() -> None:
    rng, points, std = np.random.default_rng(0), _tilted(20.0), np.full(SHAPE, 0.3)
    heights = []
    for _ in range(400):
        noisy = section(points * (1 + rng.normal(0, std) / points[2]), std, (4, 24), (60, 24))
        assert noisy is not None
        heights.append(noisy.height_mm)
    cut = section(points, std, (4, 24), (60, 24))
    assert cut is not None
    stated = cut.std_mm
    # Near the ends of the line it is uncertain by two points, in its middle by one and a half.
    assert stated[1] > 1.1 * stated[28]
    assert stated[[0, -1]].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(np.std(heights, axis=0)[1:-1], stated[1:-1], rtol=0.2)


@pytest.mark.parametrize("last", [(60, 40), (9, 44), (60, 3)])
def test_a_section_of_a_plane_is_straight_in_any_direction(last: tuple[int, int]) -> None:
    points = _tilted(35.0)
    cut = section(points, None, (5, 6), last)
    assert cut is not None
    np.testing.assert_allclose(cut.height_mm, 0, atol=2e-3)
    assert (np.diff(cut.along_mm) > 0).all()
    assert cut.along_mm[-1] == pytest.approx(
        float(np.linalg.norm(points[:, last[1], last[0]] - points[:, 6, 5]))
    )


def test_a_section_over_a_hole_has_a_gap() -> None:
    points = _tilted(0.0)
    points[:, :, 30:33] = np.nan
    cut = section(points, None, (10, 10), (50, 40))
    assert cut is not None
    assert np.isnan(cut.height_mm[20:23]).all()
    assert np.isfinite(cut.height_mm).sum() >= 36
    assert section(points, None, (31, 10), (50, 40)) is None
    assert section(points, None, (10, 10), (10, 10)) is None
