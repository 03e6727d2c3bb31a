"""Triangulated corners are where both pictures are matched best."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.geometry.bundle import (
    CAMERA,
    PROJECTOR,
    SHARED,
    STEREO,
    flatness,
    move,
    project,
    triangulate,
    vector_of,
)
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.model.board import corner_positions_mm
from tests.cases import board_poses as case

Floats = case.Floats


def _truth() -> Floats:
    shared = np.zeros(SHARED)
    for part, lens in ((CAMERA, case.CAMERA), (PROJECTOR, case.PROJECTOR)):
        shared[part] = [lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px, *lens.distortion]
    shared[STEREO] = [*vector_of(case.POSE.matrix), *case.POSE.vector_mm]
    return shared


def _squares(shared: Floats, seen: PoseObservation, points: Floats) -> Floats:
    camera, _, _ = project(shared[CAMERA], points)
    there, _ = move(np.broadcast_to(shared[STEREO], (len(points), 6)), points)
    projector, _, _ = project(shared[PROJECTOR], there)
    errors = np.concatenate([camera - seen.camera_px, projector - seen.projector_px], 1)
    return np.asarray((errors**2).sum(1))


def test_no_point_near_by_is_better() -> None:
    seen, shared = case.poses_seen(noise_px=2.0)[1], _truth()
    points = triangulate(shared, seen, np.tile([0.0, 0.0, 900.0], (len(seen.ids), 1)))
    best = _squares(shared, seen, points)
    for axis in np.eye(3):
        for step_mm in (-0.02, 0.02):
            assert (_squares(shared, seen, points + step_mm * axis) > best).all()


def test_a_bent_board_is_measured() -> None:
    board = corner_positions_mm(case.BOARD)
    bent = board + np.array([0, 0, 1000.0]) + np.where(np.arange(63) % 2, 0.5, -0.5)[:, None] * [0, 0, 1]
    found = flatness(bent, np.arange(63), case.BOARD)
    assert found.plane_rms_mm == pytest.approx(0.5, rel=0.01)
    assert found.square_mm == pytest.approx(np.hypot(30, 1), rel=1e-6)
    flat = flatness(board[:40], np.arange(40), case.BOARD)
    assert flat.square_mm == pytest.approx(30)
    assert flat.square_std_mm == pytest.approx(0, abs=1e-9)
