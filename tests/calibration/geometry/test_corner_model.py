"""Edges tell the corners of a board on the twin to a hundredth of a pixel."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.geometry.corner_model import (
    _edge_distances,
    _start,
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


def test_a_start_is_a_place_two_directions_and_a_blur() -> None:
    along = np.array([[[3.0, 3.0], [-2.0, 0.0]]])
    found = _start(np.array([[7.0, 8.0]]), along)[0]
    assert found[:4] == pytest.approx([7.0, 8.0, np.pi / 4, np.pi])
