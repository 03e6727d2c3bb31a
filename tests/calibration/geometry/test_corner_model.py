"""Edges tell the corners of a board on the twin to a hundredth of a pixel."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.geometry.corner_model import even_mosaic, fit_corners
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
