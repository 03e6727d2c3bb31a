"""Lenses and poses that no camera or projector has are told with what was found and wanted."""

from __future__ import annotations

from typing import Any

import pytest

from dsl_core.calibration.geometry.plausible import implausible
from dsl_core.calibration.geometry.pose_series import doubts
from dsl_core.calibration.geometry.solve import calibrate_geometry
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from tests.cases import board_poses as case


@pytest.fixture(scope="module")
def found() -> GeometryCalibration:
    return calibrate_geometry(case.poses_seen(), case.BOARD, case.CAMERA_PX, case.PROJECTOR_PX)


@pytest.mark.parametrize("seed", range(4))
def test_lenses_of_drawn_rigs_are_plausible(found: GeometryCalibration, seed: int) -> None:
    assert implausible(found) == []
    rig = random_rig(seed, published_rig())
    drawn = {"camera": rig.camera, "projector": rig.projector, "pose": rig.pose}
    assert implausible(found.model_copy(update=drawn)) == []


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"fx_px": 0.1 * 640}, "focal length of the projector came out as 0.1 widths"),
        ({"cy_px": 3.0 * 480}, "axis of the projector's lens came out at"),
        ({"distortion": (0.1, 40.0, 0.0, 0.0, 0.0)}, "distortion of the projector moves a corner"),
    ],
)
def test_a_lens_that_none_is_like_is_a_doubt(
    found: GeometryCalibration, changes: dict[str, Any], told: str
) -> None:
    size = {"width_px": 640, "height_px": 480}
    odd = found.model_copy(update={"projector": found.projector.model_copy(update=size | changes)})
    sentence = implausible(odd)[0]
    assert told in sentence
    assert "plausible" in sentence
    assert sentence in doubts(odd, 40.0, None)


def test_devices_that_are_a_wall_apart_are_a_doubt(found: GeometryCalibration) -> None:
    pose = found.pose.model_copy(update={"translation_mm": (9000.0, 0.0, 0.0)})
    (sentence,) = implausible(found.model_copy(update={"pose": pose}))
    assert "9000 mm apart; 5 to 5000 mm are plausible" in sentence
