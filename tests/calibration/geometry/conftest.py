"""A board before the twin, captured once for all tests of this folder."""

from __future__ import annotations

import pytest

from dsl_core.calibration.geometry.projector_corners import PoseObservation, observe_pose
from dsl_core.model.calibration.pose_frames import PoseFrames
from tests.cases.board_twin import BOARD, PROJECTOR_PX, TILTED, TILTED_SIZE_PX, frames_of


@pytest.fixture(scope="package")
def frames() -> PoseFrames:
    return frames_of(TILTED, TILTED_SIZE_PX, seed=1)


@pytest.fixture(scope="package")
def seen(frames: PoseFrames) -> PoseObservation:
    return observe_pose(frames, BOARD, PROJECTOR_PX)
