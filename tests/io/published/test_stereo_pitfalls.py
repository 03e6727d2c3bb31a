"""Calibrations that used to be misunderstood without a word are understood, doubted or refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.published.any_stereo import FoundStereo, load_any_stereo
from dsl_core.io.published.stereo_words import lit_at, placed

K = np.array([[1200.0, 0, 640], [0, 1210, 512], [0, 0, 1]])
P = np.array([[1900.0, 0, 500], [0, 1905, 700], [0, 0, 1]])
R = np.asarray(cv2.Rodrigues(np.array([0.02, 0.3, 0.01]))[0], np.float64)
T = np.array([-200.0, 10, 40])
LENSES: dict[str, Any] = {"cam_K": K, "proj_K": P, "image_size": [1280, 1024], "projector_size": [1024, 768]}
PLAIN: dict[str, Any] = {**LENSES, "R": R.tolist(), "T": T.tolist()}


def read(tmp_path: Path, parts: dict[str, Any], unit_mm: float | None = None) -> FoundStereo:
    path = tmp_path / "c.json"
    path.write_text(json.dumps(parts, default=lambda each: each.tolist()), encoding="utf-8")
    return load_any_stereo(path, unit_mm=unit_mm)


@pytest.mark.parametrize(
    ("named", "coefficients"),
    [
        ({"cam_kc": [-0.1, 0.02]}, (-0.1, 0.02, 0, 0, 0)),
        ({"cam_kc": [-0.1, 0.02, 0.003]}, (-0.1, 0.02, 0, 0, 0.003)),
        ({"cam_kc": -0.1}, (-0.1, 0, 0, 0, 0)),
        ({"cam_kc": [-0.1, 0.02, 0.001, 0.002, 0, 0]}, (-0.1, 0.02, 0.001, 0.002, 0)),
        (
            {"camera": {"k1": -0.1, "k2": 0.02, "p1": 0.001, "p2": 0.002, "k3": 0.003}},
            (-0.1, 0.02, 0.001, 0.002, 0.003),
        ),
        ({"camera": {"distortion": {"k1": -0.1}}}, (-0.1, 0, 0, 0, 0)),
    ],
)
def test_distortion_of_any_length_is_read(
    tmp_path: Path, named: dict[str, Any], coefficients: tuple[float, ...]
) -> None:
    found = read(tmp_path, {**PLAIN, **named})
    assert found.stereo.camera.distortion == coefficients
    assert found.assumed == ("no projector distortion",)


@pytest.mark.parametrize(
    "named",
    [
        {"cam_kc": [-0.1, 0.02, 0.001, 0.002, 0, 0.1]},
        {"cam_dist_coeffs": [0.1] * 9},
        {"camera": {"k1": -0.1, "k4": 0.1}},
    ],
)
def test_distortion_that_is_no_opencv_five_is_refused(tmp_path: Path, named: dict[str, Any]) -> None:
    with pytest.raises(CalibrationError, match="distortion coefficients; 4 or 5 are needed"):
        read(tmp_path, {**PLAIN, **named})


def test_the_distance_of_a_camera_is_no_distortion(tmp_path: Path) -> None:
    assert read(tmp_path, {**PLAIN, "camera_dist": 800.0}).stereo.camera.distortion == (0,) * 5


@pytest.mark.parametrize(
    ("stated", "unit_mm"),
    [
        ({"unit": "inch"}, 25.4),
        ({"units": "cm"}, 10.0),
        ({"camera": {"WorldUnits": "in"}, "projector": {"WorldUnits": "in"}}, 25.4),
        ({"board": {"square_unit": "Metres."}}, 1000.0),
        ({"units": "px", "unit": "mm", "sensor": {"unit": "um"}}, 1.0),
        ({"pixel_unit": "um", "rotation_unit": "rad", "unit": ""}, 1.0),
    ],
)
def test_lengths_are_in_the_unit_that_a_file_states(
    tmp_path: Path, stated: dict[str, Any], unit_mm: float
) -> None:
    for given_mm in (None, unit_mm):
        found = read(tmp_path, {**PLAIN, "T": T / unit_mm, **stated}, given_mm)
        np.testing.assert_allclose(found.stereo.pose.vector_mm, T)
        assert f"its lengths are in units of {unit_mm:g} mm" in found.taken


@pytest.mark.parametrize("stated", [{"unit": "furlong"}, {"unit": "mm", "T_unit": "m"}])
def test_a_unit_that_is_none_or_two_is_refused(tmp_path: Path, stated: dict[str, Any]) -> None:
    with pytest.raises(
        CalibrationError, match=r"states the unit of its lengths by unit '.*and give --unit-mm"
    ):
        read(tmp_path, {**PLAIN, **stated})


@pytest.mark.parametrize("given_mm", [1000.0, 1.0])
def test_a_unit_that_is_given_against_the_file_is_refused(tmp_path: Path, given_mm: float) -> None:
    with pytest.raises(CalibrationError, match=f"'cm', which is 10 mm, not {given_mm:g} mm as given"):
        read(tmp_path, {**PLAIN, "unit": "cm"}, given_mm)


@pytest.mark.parametrize("k1", [0.12, -0.12])
def test_four_coefficients_are_no_matrix_of_the_same_name(tmp_path: Path, k1: float) -> None:
    found = read(tmp_path, {"cam_k": [k1, 0.02, 0.001, 0.002], **PLAIN})
    assert found.names["camera matrix"] == "cam_K"
    assert found.stereo.camera.distortion == pytest.approx((k1, 0.02, 0.001, 0.002, 0))
    intrinsics = {"cam_k": [k1, 0.02, 0.001, 0.002], **PLAIN, "cam_K": None}
    found = read(tmp_path, {**intrinsics, "cam_intrinsics": [1200, 1210, 640, 512]})
    assert (found.stereo.camera.fx_px, found.stereo.camera.distortion[0]) == (1200, k1)
    assert read(tmp_path, {"cam_k": [1200, 1210, 640, 512], **PLAIN}).stereo.camera.distortion == (0,) * 5


@pytest.mark.parametrize(
    ("scale", "device"), [(1 / 1280, "camera"), (0.1, "camera"), (30, "projector"), (0.5, ""), (10, "")]
)
def test_focal_lengths_that_are_not_those_of_the_picture_are_doubted(
    tmp_path: Path, scale: float, device: str
) -> None:
    name = "proj_K" if device == "projector" else "cam_K"
    lens = np.array(PLAIN[name]) * [[scale, 1, 1], [1, scale, 1], [1, 1, 1]]
    doubts = read(tmp_path, {**PLAIN, name: lens}).doubts
    assert [each.split("'")[0] for each in doubts] == [f"the {device}"] * bool(device)
    assert all("check that its matrix is in px" in each for each in doubts)


OTHER_K, OTHER_R, OTHER_T = [[800.0, 0, 640], [0, 800, 512], [0, 0, 1]], np.eye(3), [-204.0, 0, 0]
OTHER = {"cam_K": OTHER_K, "cam_kc": [0.01] * 5, "R": OTHER_R, "T": OTHER_T}
VECTORS = {"rvec": [3.0, 0.1, 0.2], "tvec": [1.0, 2, 900]}


@pytest.mark.parametrize("is_first", [False, True])
@pytest.mark.parametrize(
    "other",
    [
        {"initial": OTHER},
        {"uncertainty": OTHER},
        {"Rectified": OTHER},
        {"run_1": OTHER},
        {"board": {"R": OTHER_R, "t": OTHER_T}},
        VECTORS,
    ],
)
def test_side_results_and_what_is_nested_do_not_count(
    tmp_path: Path, other: dict[str, Any], is_first: bool
) -> None:
    own = {**PLAIN, "cam_kc": [0.0] * 5}
    found = read(tmp_path, {**other, **own} if is_first else {**own, **other})
    np.testing.assert_allclose(found.stereo.camera.matrix, K)
    np.testing.assert_allclose(found.stereo.pose.matrix, R, atol=1e-7)
    np.testing.assert_allclose(found.stereo.pose.vector_mm, T)
    assert found.stereo.camera.distortion == (0,) * 5


def test_all_parts_are_of_the_same_result(tmp_path: Path) -> None:
    found = read(tmp_path, {"initial": OTHER, "final": {**PLAIN, "cam_kc": [0.1, 0, 0, 0, 0]}})
    assert {name.split(".")[0] for name in found.names.values()} == {"final"}


def test_of_two_results_none_is_chosen(tmp_path: Path) -> None:
    same = {"camera": {"K": K, "intrinsicMatrix": K.T, "kc": [0.1] * 5, "d": [0.1] * 5}}
    assert read(tmp_path, {**PLAIN, "cam_K": None, **same}).stereo.camera.fx_px == 1200
    with pytest.raises(CalibrationError, match=r"two values of one part that differ, a\.cam_K and b\.cam_K"):
        read(tmp_path, {"a": PLAIN, "b": OTHER})
    with pytest.raises(CalibrationError, match="differ, T and translation"):
        read(tmp_path, {**PLAIN, "translation": T * 1.01})


@pytest.mark.parametrize("is_flat", [False, True])
@pytest.mark.parametrize("name", ["RT", "PoseCamera2.T"])
def test_a_pose_may_have_its_translation_in_the_last_row(tmp_path: Path, name: str, is_flat: bool) -> None:
    pose = np.vstack([np.c_[R, T], [0, 0, 0, 1]])
    written = "RT is written for rows, as in MATLAB and DirectX: transposed".replace("RT", name)
    for matrix, is_said in ((pose, False), (pose.T, True), (pose[:3], False), (pose.T[:, :3], True)):
        if is_flat and matrix.size == 12:
            continue
        value: Any = matrix.ravel() if is_flat else matrix
        for level in reversed(name.split(".")):
            value = {level: value}
        found = read(tmp_path, {**LENSES, **value})
        np.testing.assert_allclose(found.stereo.pose.matrix, R, atol=1e-7)
        np.testing.assert_allclose(found.stereo.pose.vector_mm, T)
        assert (written in found.taken) == is_said


def test_another_model_of_lenses_is_found_in_any_encoding(tmp_path: Path) -> None:
    (tmp_path / "c.json").write_text('{"model": "fisheye"}', encoding="utf-16")
    with pytest.raises(CalibrationError, match="describes a lens by the model 'fisheye'"):
        load_any_stereo(tmp_path / "c.json")


@pytest.mark.parametrize(
    "given", [[-0.1, float("nan"), 0, 0, 0], [-0.1, None, 0, 0, 0], "-0.1, 0.02, 0, 0, 0"]
)
def test_a_distortion_that_cannot_be_read_is_not_left_out(tmp_path: Path, given: Any) -> None:
    with pytest.raises(CalibrationError, match="cam_dist is named as a distortion, but is not all finite"):
        read(tmp_path, {**PLAIN, "cam_dist": given})


def test_words_about_a_distortion_are_none(tmp_path: Path) -> None:
    said = {"distortion_model": "plumb_bob", "note": "dist measured", "cam_date": None}
    assert read(tmp_path, {**PLAIN, **said}).stereo.camera.distortion == (0,) * 5


UP = np.diag([1.0, -1, -1])


@pytest.mark.parametrize(
    ("turn", "shift", "is_doubted"),
    [
        (R, T, False),
        (R, -T, False),
        (R.T, T, False),
        (UP @ R, UP @ T, True),
        ([0.5, -2.0, 0.1], T, True),
        (np.asarray(cv2.Rodrigues(np.array([0.0, np.pi, 0]))[0]), T, True),
    ],
)
def test_a_projector_that_lights_nothing_the_camera_sees_is_doubted(
    tmp_path: Path, turn: Any, shift: Any, is_doubted: bool
) -> None:
    found = read(tmp_path, {**LENSES, "R": turn, "T": shift})
    told = [each for each in found.doubts if "light what the camera sees" in each]
    assert len(told) == is_doubted
    assert ("lights up to 0% of" in placed(found.stereo)) == is_doubted


def test_where_light_meets_the_camera_follows_from_lenses_and_pose(tmp_path: Path) -> None:
    lens = np.array([[1000.0, 0, 499.5], [0, 1000, 499.5], [0, 0, 1]])
    sizes = {"image_size": [1000, 1000], "projector_size": [1000, 1000]}
    turned = np.asarray(cv2.Rodrigues(np.array([0.0, np.arctan(0.25), 0]))[0])
    apart = {"cam_K": lens, "proj_K": lens, **sizes, "T": -turned @ [200.0, 0, 0], "R": turned}
    share, depth_mm = lit_at(read(tmp_path, apart).stereo)
    # The axes cross at 800 mm; the slant of 14 degrees lets the fields meet best before that.
    assert 0.85 < share <= 1
    assert 400 < depth_mm < 1000
    parallel = {**apart, "T": [-200.0, 0, 0], "R": np.eye(3)}
    share, depth_mm = lit_at(read(tmp_path, parallel).stereo)
    assert share == 1.0
    assert depth_mm > 200 / (0.5 / 15)


def test_a_rotation_next_to_transposed_lenses_is_told_as_not_transposed(tmp_path: Path) -> None:
    turned = {**PLAIN, "cam_K": K.T, "proj_K": P.T}
    assert "R is not transposed, unlike the matrices of the lenses" in read(tmp_path, turned).taken
    assert not any("unlike" in each for each in read(tmp_path, PLAIN).taken)
