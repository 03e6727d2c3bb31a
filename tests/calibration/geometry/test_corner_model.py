"""Edges tell the corners of a board on the twin to a hundredth of a pixel."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf

from dsl_core.calibration.geometry.corner_model import (
    _edge_distances,
    _levels,
    _model,
    _profile,
    _start,
    _step,
    _windows,
    even_mosaic,
    fit_corners,
)
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.optics.sensor import bayer_channels
from tests.cases.board_twin import tilted_errors


def test_edges_tell_corners_to_a_hundredth_of_a_pixel(seen: PoseObservation) -> None:
    off, _ = tilted_errors(seen)
    assert len(off) == 77
    assert np.sqrt((off**2).mean()) < 0.012
    assert np.abs(off.mean(0)).max() < 0.004


def test_bent_edges_do_not_draw_corners_to_the_axis(seen: PoseObservation) -> None:
    off, _ = tilted_errors(seen)
    centre = np.array([222, 145]) * (428.9 / 890, 294.8 / 580)
    away = seen.camera_px - centre
    # Edges taken as straight would give -2.2e-5.
    assert abs((off * away).sum() / (away**2).sum()) < 1e-5


def test_colours_of_a_mosaic_are_made_even() -> None:
    rows, columns = np.mgrid[:40, :60]
    light = 100.0 + rows + 0.5 * columns
    gains = np.array([0.5, 1.0, 0.7])[bayer_channels("GBRG", 40, 60)]
    even = even_mosaic(light * gains, "GBRG", 6.0)
    np.testing.assert_allclose(even[8:-8, 8:-8], light[8:-8, 8:-8], rtol=2e-3)


def test_a_monochrome_picture_is_even_as_it_is() -> None:
    light = np.random.default_rng(0).uniform(50, 150, (40, 60))
    np.testing.assert_array_equal(even_mosaic(light, "MONO", 6.0), light.astype(np.float32))


def test_a_corner_out_of_sight_is_no_corner() -> None:
    flat = np.full((60, 60), 50.0) + np.random.default_rng(0).normal(0, 1, (60, 60))
    along = np.array([[[15.0, 0.0], [0.0, 15.0]]])
    assert np.isnan(fit_corners(flat, np.array([[30.0, 30.0]]), along).points_px).all()


def test_windows_hold_the_pixels_within_reach_and_none_outside_the_picture() -> None:
    grey = np.arange(30.0).reshape(5, 6)
    grey[2, 3] = np.nan
    places, values, usable = _windows(grey, np.array([[4.6, 3.4], [2.0, 2.0]]), np.array([1.5, 2.0]))
    assert places.shape == (2, 25, 2)
    assert places[0].mean(0).tolist() == [5.0, 3.0]
    for corner, (centre, reach) in enumerate((((4.6, 3.4), 1.5), ((2.0, 2.0), 2.0))):
        for (x, y), value, use in zip(places[corner], values[corner], usable[corner], strict=True):
            there = 0 <= x <= 5 and 0 <= y <= 4 and np.hypot(x - centre[0], y - centre[1]) <= reach
            there = there and (x, y) != (3, 2)
            assert use == there, (x, y)
            assert value == (6 * y + x if there else 0.0)


def test_distances_to_edges_follow_their_bend() -> None:
    # An edge along x, and one along y that bends by 0.02 per pixel towards its left.
    state = np.array([[10.0, 20.0, 0.0, np.pi / 2, 0.5]])
    places = np.array([[[13.0, 20.0], [10.0, 26.0], [12.0, 23.0]]])
    first, second = _edge_distances(state, places, np.array([[0.0, 0.02]]))[:, 0]
    assert first == pytest.approx([0.0, 6.0, 3.0])
    assert second == pytest.approx([-3.0, -0.5 * 0.02 * 36, -2 - 0.5 * 0.02 * 9])
    # Along an edge at 45 degrees the bend counts from the corner on.
    state[0, 2] = np.pi / 4
    first = _edge_distances(state, np.array([[[13.0, 23.0], [13.0, 17.0]]]), np.array([[0.02, 0.0]]))[0, 0]
    assert first == pytest.approx([-0.01 * 18, -(18**0.5)])


def test_a_start_is_a_place_two_directions_and_a_blur() -> None:
    along = np.array([[[3.0, 3.0], [-2.0, 0.0]]])
    found = _start(np.array([[7.0, 8.0]]), along)[0]
    assert found == pytest.approx([7.0, 8.0, np.pi / 4, np.pi, 0.5])


def averaged(distance: np.ndarray, angle: float, blur: float) -> np.ndarray:
    """A blurred edge from -1 to 1, averaged over a pixel by quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(30)
    halves = [max(0.5 * abs(part), 0.02) for part in (np.sin(angle), np.cos(angle))]
    x, y = (half * nodes for half in halves)
    places = distance[:, None, None] + x[:, None] + y
    return np.asarray((erf(places / (2**0.5 * blur)) * weights[:, None] * weights / 4).sum((1, 2)))


@pytest.mark.parametrize("angle", [0.0, 0.05, 0.7, -1.2, np.pi / 2, 3.0])
def test_a_profile_is_an_edge_averaged_over_a_pixel_with_its_derivatives(angle: float) -> None:
    distance, blur, small = np.linspace(-2.2, 2.0, 15), 0.4, 1e-5
    value, slope, by_blur = _profile(distance, np.array([angle]), np.array([blur]))
    assert value == pytest.approx(averaged(distance, angle, blur), abs=1e-9)
    ahead, behind = (averaged(distance + step, angle, blur) for step in (small, -small))
    assert slope == pytest.approx((ahead - behind) / (2 * small), abs=1e-7)
    wide, narrow = (averaged(distance, angle, blur + step) for step in (small, -small))
    assert by_blur == pytest.approx((wide - narrow) / (2 * small), abs=1e-7)


STATE = np.array([[10.3, 9.8, 0.2, 1.9, 0.6]])
PLACES = np.stack([part.ravel() for part in np.meshgrid(np.arange(21.0), np.arange(21.0))], 1)[None]
START = np.array([[10.0, 10.0]])
STRAIGHT = np.zeros((1, 2))
LEVELS = np.array([[100.0, 0.5, -0.25, 60.0, 0.2, 0.1]])


def product(state: np.ndarray) -> np.ndarray:
    first, second = _edge_distances(state, PLACES, STRAIGHT)[:, 0]
    blur = state[:, 4]
    return np.asarray(_profile(first, state[:, 2], blur)[0] * _profile(second, state[:, 3], blur)[0])


def drawn(state: np.ndarray = STATE, levels: np.ndarray = LEVELS) -> np.ndarray:
    """The pixels of a corner, (1, pixels)."""
    return np.asarray(_model(state, PLACES, START, STRAIGHT)[0] @ levels[0])


def test_levels_are_two_planes_and_slopes_are_derivatives_of_the_edges() -> None:
    model, slope = _model(STATE, PLACES, START, STRAIGHT)
    off = PLACES[0] - START[0]
    both = product(STATE)
    assert model[0, :, :3] == pytest.approx(np.column_stack([np.ones(441), off]))
    assert model[0, :, 3:] == pytest.approx(np.column_stack([both, off * both[:, None]]))
    for part in range(5):
        step = 1e-5 * np.eye(5)[part]
        wanted = (product(STATE + step) - product(STATE - step)) / 2e-5
        # That the square of a pixel looks wider across an inclined edge is left out of the slopes.
        assert slope[0, :, part] == pytest.approx(wanted, abs=4e-3 if part in (2, 3) else 1e-6)


def test_levels_are_those_of_the_pixels_that_count() -> None:
    values, usable = drawn(), np.ones((1, 441), bool)
    values[0, ::7], usable[0, ::7] = 1e4, False
    found = _levels(_model(STATE, PLACES, START, STRAIGHT)[0], values, usable)
    assert found == pytest.approx(LEVELS, rel=1e-4)


def test_a_step_goes_to_a_corner_nearby() -> None:
    near = STATE + np.array([0.02, -0.03, 0.004, -0.003, 0.01])
    model, slope = _model(near, PLACES, START, STRAIGHT)
    usable = np.ones((1, 441), bool)
    values = drawn()
    levels = _levels(model, values, usable)
    values[0, 220], usable[0, 220] = 1e4, False
    found = _step(near, slope, model, levels, values, usable)
    assert found == pytest.approx(STATE, abs=2e-3)


def test_a_step_is_limited_and_so_is_the_blur() -> None:
    model, slope = _model(STATE, PLACES, START, STRAIGHT)
    strength = model[0, :, :3] @ LEVELS[0, 3:]
    usable = np.ones((1, 441), bool)

    def stepped(move: list[float]) -> np.ndarray:
        values = (model[0] @ LEVELS[0] + strength * (slope[0] @ move))[None]
        return np.asarray((_step(STATE, slope, model, LEVELS, values, usable) - STATE)[0])

    assert stepped([0.9, -0.9, 0.18, -0.18, 0.27]) == pytest.approx([0.9, -0.9, 0.18, -0.18, 0.27], abs=1e-4)
    assert stepped([5, -5, 3, -3, 2]) == pytest.approx([1, -1, 0.2, -0.2, 0.3])
    assert stepped([-5, 5, -3, 3, -2]) == pytest.approx([-1, 1, -0.2, 0.2, -0.3])
    sharp, wide = STATE.copy(), STATE.copy()
    sharp[0, 4], wide[0, 4] = 0.2, 3.9
    for state, sign, limit in ((sharp, -1, 0.12), (wide, 1, 4.0)):
        model, slope = _model(state, PLACES, START, STRAIGHT)
        strength = model[0, :, :3] @ LEVELS[0, 3:]
        values = (model[0] @ LEVELS[0] + sign * strength * slope[0, :, 4])[None]
        assert _step(state, slope, model, LEVELS, values, usable)[0, 4] == pytest.approx(limit)


def fitted(
    grey: np.ndarray, pitch: float, start: tuple[float, float] = (30.0, 30.0), gap: float = 1.0
) -> np.ndarray:
    along = pitch * np.array([[[1.0, 0.1], [-0.1, 1.0]]]) / np.hypot(1, 0.1)
    found = fit_corners(grey, np.array([start]), along, gap)
    return np.append(found.points_px[0], found.blur_px)


def corner(level: float = 60.0, at: tuple[float, float] = (30.2, 29.7)) -> np.ndarray:
    """A picture of 60 x 60 px around one corner."""
    angles = np.arctan2([0.1, 1.0], [1.0, -0.1])
    y, x = np.mgrid[:60, :60].astype(float)
    edges = [
        _profile((y - at[1]) * np.cos(a) - (x - at[0]) * np.sin(a), np.array([a]), np.array([0.6]))[0]
        for a in angles
    ]
    return np.asarray(100.0 + level * edges[0] * edges[1])


def distances() -> tuple[np.ndarray, np.ndarray]:
    """Of the pixels of `corner`: from where the search starts, and from the nearer edge through there."""
    y, x = np.mgrid[:60, :60] - 30.0
    across = np.abs([y * 1 - x * 0.1, -0.1 * y - x]) / np.hypot(1, 0.1)
    return np.hypot(x, y), across.min(0)


@pytest.mark.parametrize(("pitch", "reach"), [(15.0, 9.0), (40.0, 16.0), (4.0, 3.0)])
def test_pixels_count_up_to_a_share_of_the_distance_between_corners(pitch: float, reach: float) -> None:
    away, _ = distances()
    grey = corner(at=(30.2, 29.9))
    for part, is_seen in ((away > reach + 0.01, False), ((away <= reach) & (away > reach - 1.1), True)):
        spoilt = np.where(part, np.where(np.arange(60) > 30, 300.0, 20.0), grey)
        off = np.abs(fitted(spoilt, pitch)[:2] - [30.2, 29.9]).max()
        assert (not off < 1e-3) == is_seen


@pytest.mark.parametrize(("pitch", "gap", "limit"), [(25.0, 0.3, 6.5), (10.0, 0.1, 1.5), (10.0, 0.24, 1.5)])
def test_markers_beside_the_edges_do_not_count(pitch: float, gap: float, limit: float) -> None:
    _, across = distances()
    grey, right = corner(at=(30.0, 30.0)), np.arange(60) > 30
    for marker, is_seen in ((across > limit, False), ((across > limit - 0.4) & (across < limit), True)):
        off = np.abs(fitted(np.where(marker & right, 500.0, grey), pitch, gap=gap)[:2] - 30.0).max()
        assert (not off < 1e-3) == is_seen


def test_a_corner_without_contrast_or_far_from_where_it_was_sought_is_none() -> None:
    assert fitted(corner(), 15.0) == pytest.approx([30.2, 29.7, 0.6], abs=1e-3)
    # The contrast is five percent of the level; the start may be wrong by half the reach, or by a pixel.
    assert np.isfinite(fitted(corner(5.4), 15.0)).all()
    assert np.isnan(fitted(corner(4.6), 15.0)[:2]).all()
    assert np.isfinite(fitted(corner(), 15.0, (33.7, 32.3))).all()
    assert np.isnan(fitted(corner(), 15.0, (33.9, 32.6))[:2]).all()


def test_a_window_of_nothing_has_levels_of_nothing() -> None:
    model = np.random.default_rng(1).standard_normal((2, 20, 6))
    values, usable = np.ones((2, 20)), np.ones((2, 20), bool)
    usable[1, 3:] = False
    found = _levels(model, values, usable)
    assert found[0] == pytest.approx(np.linalg.lstsq(model[0], values[0])[0], rel=1e-5)
    # Three pixels and six levels: any that explain them will do, and none is far from nothing.
    assert model[1, :3] @ found[1] == pytest.approx(values[1, :3], abs=1e-4)
    assert np.abs(found[1]).max() < 10
