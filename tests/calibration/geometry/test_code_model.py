"""Grey values of the code tell where the projector sees the corners of a board, to thousandths of a pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dsl_core.calibration.geometry.code_model import CornerWindow, code_light, refine_maps
from dsl_core.calibration.geometry.projector_corners import PoseObservation, observe_pose
from dsl_core.model.calibration.pose_frames import PoseFrames
from tests.cases.board_twin import BOARD, PROJECTOR_PX, tilted_errors


def test_grey_values_of_the_code_tell_places_to_a_few_thousandths(seen: PoseObservation) -> None:
    _, code = tilted_errors(seen)
    assert np.sqrt((code**2).mean()) < 0.003


def test_pixels_that_are_read_wrongly_do_no_harm(frames: PoseFrames, seen: PoseObservation) -> None:
    """Dust: every tenth pixel of the finest bits is from elsewhere."""
    rng = np.random.default_rng(3)
    pairs = [np.array(picture) for picture in frames.pairs]
    lost = rng.random(pairs[0].shape) < 0.1
    pairs[18][lost], pairs[19][lost] = pairs[19][lost].copy(), pairs[18][lost].copy()
    _, code = tilted_errors(observe_pose(replace(frames, pairs=pairs), BOARD, PROJECTOR_PX))
    assert np.sqrt((code**2).mean()) < 0.006


def test_a_coarse_map_is_refined_from_half_a_pixel_away(frames: PoseFrames, seen: PoseObservation) -> None:
    windows = [CornerWindow.around(point, 9.0, np.shape(frames.white)) for point in seen.camera_px]
    linear = seen.slopes[:, 0] * 9.0
    start = np.concatenate([seen.projector_px[:, :1] + 0.5, linear, np.zeros((77, 3))], 1)
    found = refine_maps(code_light(frames, PROJECTOR_PX)[0], windows, start)
    assert np.abs(found[:, 0] - seen.projector_px[:, 0]).max() < 0.01
