"""Corners of a board on the twin: edges to a hundredth of a pixel, the code at pixels to a thousandth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.calibration.geometry.code_model import CornerWindow, code_light, refine_maps
from dsl_core.calibration.geometry.corner_model import even_mosaic, fit_corners
from dsl_core.calibration.geometry.projector_corners import PoseObservation, observe_pose
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.optics.sensor import bayer_channels
from tests.cases.board_twin import BOARD, PROJECTOR_PX, frames_of, true_corners

POSE = {
    "x_mm": 12.0,
    "y_mm": 3.0,
    "depth_mm": 660.0,
    "tilt_x_deg": 18.0,
    "tilt_y_deg": -14.0,
    "roll_deg": 5.0,
}


@pytest.fixture(scope="module")
def frames() -> PoseFrames:
    return frames_of(POSE, (222, 145), seed=1)


@pytest.fixture(scope="module")
def seen(frames: PoseFrames) -> PoseObservation:
    return observe_pose(frames, BOARD, PROJECTOR_PX)


def errors(seen: PoseObservation) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of corners in the camera, and of the code at the places where it was read."""
    camera, projector = true_corners(POSE, (222, 145))
    nearest = np.linalg.norm(camera[:, None] - seen.camera_px, axis=2).argmin(0)
    off = seen.camera_px - camera[nearest]
    return off, seen.projector_px - projector[nearest] - np.einsum("nij,nj->ni", seen.slopes, off)


def test_edges_tell_corners_to_a_hundredth_of_a_pixel(seen: PoseObservation) -> None:
    off, _ = errors(seen)
    assert len(off) == 77
    assert np.sqrt((off**2).mean()) < 0.012
    assert np.abs(off.mean(0)).max() < 0.004


def test_bent_edges_do_not_draw_corners_to_the_axis(seen: PoseObservation) -> None:
    off, _ = errors(seen)
    centre = np.array([222, 145]) * (428.9 / 890, 294.8 / 580)
    away = seen.camera_px - centre
    # Edges taken as straight would give -2.2e-5.
    assert abs((off * away).sum() / (away**2).sum()) < 1e-5


def test_grey_values_of_the_code_tell_places_to_a_few_thousandths(seen: PoseObservation) -> None:
    _, code = errors(seen)
    assert np.sqrt((code**2).mean()) < 0.003


def test_pixels_that_are_read_wrongly_do_no_harm(frames: PoseFrames, seen: PoseObservation) -> None:
    """Dust: every tenth pixel of the finest bits is from elsewhere."""
    rng = np.random.default_rng(3)
    pairs = [np.array(picture) for picture in frames.pairs]
    lost = rng.random(pairs[0].shape) < 0.1
    pairs[18][lost], pairs[19][lost] = pairs[19][lost].copy(), pairs[18][lost].copy()
    _, code = errors(observe_pose(replace(frames, pairs=pairs), BOARD, PROJECTOR_PX))
    assert np.sqrt((code**2).mean()) < 0.006


def test_a_coarse_map_is_refined_from_half_a_pixel_away(frames: PoseFrames, seen: PoseObservation) -> None:
    windows = [CornerWindow.around(point, 9.0, np.shape(frames.white)) for point in seen.camera_px]
    linear = seen.slopes[:, 0] * 9.0
    start = np.concatenate([seen.projector_px[:, :1] + 0.5, linear, np.zeros((77, 3))], 1)
    found = refine_maps(code_light(frames, PROJECTOR_PX)[0], windows, start)
    assert np.abs(found[:, 0] - seen.projector_px[:, 0]).max() < 0.01


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
