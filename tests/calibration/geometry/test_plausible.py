"""Lenses and poses that no camera or projector has are told with what was found and wanted."""

from __future__ import annotations

from typing import Any

import pytest

from dsl_core.calibration.geometry.plausible import _corner_share, _of_lens, implausible
from dsl_core.calibration.geometry.pose_series import doubts
from dsl_core.calibration.geometry.solve import calibrate_geometry
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.geometry import Lens
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


def plain_lens(**changes: Any) -> Lens:
    given = {
        "width_px": 1000,
        "height_px": 500,
        "fx_px": 1000.0,
        "fy_px": 1000.0,
        "cx_px": 500.0,
        "cy_px": 250.0,
    }
    return Lens(**{**given, **changes})


@pytest.mark.parametrize(
    ("inside", "outside"),
    [
        ({"fx_px": 301.0}, {"fx_px": 299.0}),
        ({"fx_px": 9990.0}, {"fx_px": 10010.0}),
        ({"cx_px": -499.0}, {"cx_px": -501.0}),
        ({"cx_px": 1499.0}, {"cx_px": 1501.0}),
        ({"cy_px": -249.0}, {"cy_px": -251.0}),
        ({"cy_px": 749.0}, {"cy_px": 751.0}),
    ],
)
def test_both_sides_of_what_a_lens_can_be(inside: dict[str, Any], outside: dict[str, Any]) -> None:
    assert _of_lens("camera", plain_lens(**inside)) == []
    (sentence,) = _of_lens("camera", plain_lens(**outside))
    assert "camera" in sentence


def test_distortion_counts_at_the_farthest_corner_of_both_devices() -> None:
    off = plain_lens(cx_px=400.0, cy_px=200.0, distortion=(0.5, -0.3, 9.0, 9.0, 0.2))
    square = (0.599**2) + (0.299**2)
    assert _corner_share(off) == pytest.approx(abs(0.5 * square - 0.3 * square**2 + 0.2 * square**3))
    for share, told in ((0.49, False), (0.51, True), (-0.51, True)):
        lens = plain_lens(cx_px=499.5, cy_px=249.5, distortion=(share / (0.4995**2 + 0.2495**2), 0, 0, 0, 0))
        assert bool(_of_lens("projector", lens)) == told


@pytest.mark.parametrize(
    ("distance_mm", "told"), [(4.9, True), (5.1, False), (4990.0, False), (5010.0, True)]
)
def test_both_sides_of_how_far_devices_can_be_apart(
    found: GeometryCalibration, distance_mm: float, told: bool
) -> None:
    pose = found.pose.model_copy(update={"translation_mm": (0.6 * distance_mm, 0.0, 0.8 * distance_mm)})
    assert bool(implausible(found.model_copy(update={"pose": pose}))) == told


def test_what_is_plausible_is_said_in_the_sentence() -> None:
    (focal,) = _of_lens("camera", plain_lens(fx_px=100.0, fy_px=100.0))
    assert "came out as 0.1 widths of its picture; 0.3 to 10 are plausible" in focal
    (axis,) = _of_lens("camera", plain_lens(cx_px=-510.0))
    assert "at -51% of its picture's width and 50% of its height; -50% to 150% are plausible" in axis
    (bent,) = _of_lens("camera", plain_lens(distortion=(2.0, 0.0, 0.0, 0.0, 0.0)))
    assert "of its distance from the middle; at most 50% are plausible" in bent
