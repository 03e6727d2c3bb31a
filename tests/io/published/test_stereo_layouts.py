"""Calibrations in the layouts of public programs are read as they were meant, or refused with the reason.

SLStudio, scan3d-capture of Moreno and Taubin, procam-calibration, OpenCV's stereo_calib, Kalibr, ROS, MATLAB.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.io.published.any_stereo import FoundStereo, load_any_stereo
from dsl_core.io.published.stereo_rig import lenses_on
from dsl_core.io.published.stereo_words import placed
from tests.cases.small_rig import small_rig

Floats = NDArray[np.float64]
CAMERA, PROJECTOR = (1280, 1024), (1024, 768)
K, P = (
    np.array([[1400.0, 0, 650], [0, 1405, 500], [0, 0, 1]]),
    np.array([[1900.0, 0, 520], [0, 1895, 760], [0, 0, 1]]),
)
DK, DP = np.array([[-0.1, 0.02, 0.001, -0.002, 0.0]]), np.array([[0.05, -0.01, 0.0, 0.0, 0.0]])
VECTOR = np.array([0.02, 0.3, -0.01])
R: Floats = np.asarray(cv2.Rodrigues(VECTOR)[0], np.float64)
T = np.array([[-150.0], [12], [20]])
PLAIN = {"cam_K": K, "proj_K": P, "R": R, "T": T}


def opencv(path: Path, parts: dict[str, Any]) -> Path:
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in parts.items():
        file.write(name, value)
    file.release()
    return path


def as_json(path: Path, parts: dict[str, Any]) -> Path:
    path.write_text(json.dumps(parts, default=lambda each: each.tolist()), encoding="utf-8")
    return path


def require_right(found: FoundStereo, has_distortion: bool = True) -> None:
    stereo = found.stereo
    np.testing.assert_allclose(stereo.camera.matrix, K)
    np.testing.assert_allclose(stereo.projector.matrix, P)
    np.testing.assert_allclose(stereo.pose.matrix, R, atol=1e-7)
    np.testing.assert_allclose(stereo.pose.vector_mm, T[:, 0], atol=1e-6)
    if has_distortion:
        np.testing.assert_allclose([stereo.camera.distortion, stereo.projector.distortion], [DK[0], DP[0]])


SLSTUDIO = {
    "Kc": K, "kc": DK.T, "cam_error": 0.2, "Kp": P, "kp": DP.T, "Rp": R, "Tp": T,
    "frameWidth": 1280, "frameHeight": 1024, "screenResX": 1024, "screenResY": 768,
}  # fmt: skip
PROCAM = {
    "img_shape": np.array([[1024.0], [1280]]), "cam_int": K, "cam_dist": DK, "proj_int": P, "proj_dist": DP,
    "roration": R, "translation": T,
}  # fmt: skip
SCAN3D = {"cam_K": K, "cam_kc": DK, "proj_K": P, "proj_kc": DP, "R": R, "T": T, "stereo_error": 0.3}
STEREO = {"M1": K, "D1": DK, "M2": P, "D2": DP, "R": R, "T": T, "R1": R, "P1": np.eye(3, 4), "Q": np.eye(4)}


@pytest.mark.parametrize("ending", ["xml", "yml", "json"])
@pytest.mark.parametrize("parts", [SLSTUDIO, PROCAM, SCAN3D, STEREO])
def test_files_of_opencv_programs(tmp_path: Path, parts: dict[str, Any], ending: str) -> None:
    path = opencv(tmp_path / f"c.{ending}", parts)
    sizes = {"frameWidth": (None, None), "img_shape": (None, PROJECTOR)}
    given = next((sizes[name] for name in sizes if name in parts), (CAMERA, PROJECTOR))
    found = load_any_stereo(path, *given)
    require_right(found)
    stereo = found.stereo
    assert (stereo.camera.width_px, stereo.camera.height_px) == CAMERA
    assert (stereo.projector.width_px, stereo.projector.height_px) == PROJECTOR
    assert "the pose leads from camera to projector (x_projector = R x_camera + t)" in found.taken
    assert found.doubts == ()
    assert "the projector is 151.8 mm from the camera (149.3 mm right, 10.44 mm above" in placed(stereo)


def test_matlab_writes_matrices_transposed_and_counts_from_one(tmp_path: Path) -> None:
    one = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
    first, second = (
        {"IntrinsicMatrix": (k + one).T, "RadialDistortion": d[0, :2], "TangentialDistortion": d[0, 2:4],
         "ImageSize": size[::-1]}
        for k, d, size in ((K, DK, CAMERA), (P, DP, PROJECTOR))
    )  # fmt: skip
    pose = {"RotationOfCamera2": R.T, "TranslationOfCamera2": T[:, 0]}
    path = as_json(
        tmp_path / "m.json", {"s": {"CameraParameters1": first, "CameraParameters2": second, **pose}}
    )
    found = load_any_stereo(path)
    require_right(found)
    assert any("as in MATLAB" in each for each in found.taken)


def test_later_matlab_does_not_transpose_but_counts_from_one(tmp_path: Path) -> None:
    one = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
    first, second = ({"K": k + one, "ImageSize": size[::-1]} for k, size in ((K, CAMERA), (P, PROJECTOR)))
    pose = {"R": R, "Translation": T[:, 0]}
    path = as_json(
        tmp_path / "m.json", {"CameraParameters1": first, "CameraParameters2": second, "PoseCamera2": pose}
    )
    found = load_any_stereo(path)
    require_right(found, has_distortion=False)
    assert "CameraParameters1.K is written as in MATLAB: with pixels from 1" in found.taken


WORLD_R: Floats = np.asarray(cv2.Rodrigues(np.array([0.4, 0.1, -0.05]))[0], np.float64)
WORLD_T = np.array([-100.0, -80, 900])


@pytest.mark.parametrize(
    ("poses", "of_camera", "of_projector"),
    [
        ({"cam_R": WORLD_R, "cam_T": WORLD_T, "proj_R": R, "proj_T": T}, "cam_R", "proj_R"),
        ({"Rc": WORLD_R, "Tc": WORLD_T, "Rp": R, "Tp": T}, "Rc", "Rp"),
        ({"cam_R": np.eye(3), "cam_T": WORLD_T, "proj_R": R, "proj_T": T}, "cam_T", "proj_T"),
        (
            {"camera": {"rvec": [0.4, 0, 0], "tvec": WORLD_T}, "projector": {"rvec": VECTOR, "tvec": T}},
            r"camera\.rvec", r"projector\.rvec",
        ),
        ({"cam_pose": np.c_[WORLD_R, WORLD_T], "proj_pose": np.c_[R, T]}, "cam_pose", "proj_pose"),
    ],
)  # fmt: skip
def test_poses_of_both_devices_are_not_taken_for_the_one_between_them(
    tmp_path: Path, poses: dict[str, Any], of_camera: str, of_projector: str
) -> None:
    path = as_json(tmp_path / "c.json", {"cam_K": K, "proj_K": P} | poses)
    with pytest.raises(CalibrationError, match=rf"camera \({of_camera}\) and .*\({of_projector}\).*Rp Rc"):
        load_any_stereo(path, CAMERA, PROJECTOR)


@pytest.mark.parametrize("rounding", [0.0, 1e-16, 1e-9])
def test_a_camera_at_the_origin_leaves_the_projectors_pose_the_one_between_them(
    tmp_path: Path, rounding: float
) -> None:
    poses = {"cam_R": np.eye(3) + rounding, "cam_T": [0, 0, 0], "proj_R": R, "proj_T": T}
    path = as_json(tmp_path / "c.json", {"cam_K": K, "proj_K": P, **poses})
    require_right(load_any_stereo(path, CAMERA, PROJECTOR), has_distortion=False)


def test_radial_coefficients_of_matlab_stand_around_the_tangential_ones(tmp_path: Path) -> None:
    radial, tangential = [-0.1, 0.02, 0.3], [0.001, -0.002]
    camera = {"K": K, "RadialDistortion": radial, "TangentialDistortion": tangential}
    alone = {"K": P, "RadialDistortion": radial}
    path = as_json(tmp_path / "m.json", {"camera": camera, "projector": alone, "R": R, "T": T})
    found = load_any_stereo(path, CAMERA, PROJECTOR)
    assert found.stereo.camera.distortion == (-0.1, 0.02, 0.001, -0.002, 0.3)
    assert found.stereo.projector.distortion == (-0.1, 0.02, 0.0, 0.0, 0.3)
    assert (found.assumed, found.taken[0]) == (
        (),
        "projector.RadialDistortion is without tangential distortion",
    )


def kalibr(model: str) -> str:
    pose = np.vstack([np.hstack([R, T / 1000]), [0, 0, 0, 1]]).tolist()
    return (
        f"cam0:\n  camera_model: pinhole\n  distortion_model: {model}\n"
        f"  distortion_coeffs: {DK[0, :4].tolist()}\n  intrinsics: [1400.0, 1405.0, 650.0, 500.0]\n"
        "  resolution: [1280, 1024]\n"
        f"cam1:\n  T_cn_cnm1: {pose}\n  distortion_coeffs: {DP[0, :4].tolist()}\n"
        "  intrinsics: [1900.0, 1895.0, 520.0, 760.0]\n  resolution: [1024, 768]\n"
    )


def test_kalibr_chains_are_in_metres_which_is_doubted(tmp_path: Path) -> None:
    path = tmp_path / "camchain.yaml"
    path.write_text(kalibr("radtan"), encoding="utf-8")
    require_right(load_any_stereo(path, unit_mm=1000))
    found = load_any_stereo(path)
    assert found.doubts == (
        "the projector would be 0.152 mm from the camera; if lengths are in metres, give --unit-mm 1000",
    )
    assert "cam0.intrinsics is the camera's, cam1.intrinsics the projector's" in found.taken
    path.write_text(kalibr("equidistant"), encoding="utf-8")
    with pytest.raises(CalibrationError, match="describes a lens by the model 'equidistant'"):
        load_any_stereo(path)


@pytest.mark.parametrize(
    ("note", "model"),
    [
        ({"model_type": "MEI"}, "MEI"),
        ({"camera": {"model": "omni"}}, "omni"),
        ({"lens": "Fisheye"}, "Fisheye"),
        ({"fisheye": False}, ""),
        ({"author": "Mei Li", "company": "Omni"}, ""),
    ],
)
def test_other_models_of_lenses_are_refused_but_not_names_of_people(
    tmp_path: Path, note: dict[str, Any], model: str
) -> None:
    path = as_json(tmp_path / "c.json", {**PLAIN, **note})
    if not model:
        require_right(load_any_stereo(path, CAMERA, PROJECTOR), False)
        return
    with pytest.raises(CalibrationError, match=f"describes a lens by the model '{model}'"):
        load_any_stereo(path, CAMERA, PROJECTOR)


def test_a_part_with_numbers_that_are_not_finite_is_named(tmp_path: Path) -> None:
    path = as_json(tmp_path / "c.json", {**PLAIN, "cam_K": [[float("nan"), 0, 1], [0, 1, 1], [0, 0, 1]]})
    with pytest.raises(CalibrationError, match=r"lacks camera matrix; .* \(not finite: cam_K\)"):
        load_any_stereo(path, CAMERA, PROJECTOR)


def test_a_projector_at_the_camera_is_doubted_and_makes_no_rig(tmp_path: Path) -> None:
    path = as_json(tmp_path / "c.json", {**PLAIN, "T": [0, 0, 0]})
    found = load_any_stereo(path, CAMERA, PROJECTOR)
    assert found.doubts == ("camera and projector are at one place, so nothing has a depth",)
    assert placed(found.stereo).endswith("0 mm from the camera (at the same place)")
    with pytest.raises(
        CalibrationError, match=r"c\.json: camera and projector are at one place, so nothing has a depth\. A"
    ):
        lenses_on(small_rig(), found, "c.json")
    metres = load_any_stereo(as_json(tmp_path / "m.json", {**PLAIN, "T": [0.2, 0, 0]}), CAMERA, PROJECTOR)
    with pytest.raises(
        CalibrationError, match=r"m\.json: the projector would be 0\.2 mm .*give --unit-mm 1000\."
    ):
        lenses_on(small_rig(), metres, "m.json")


def test_nested_names_and_vectors(tmp_path: Path) -> None:
    camera = {"matrix": K, "distortion": DK[0], "width": 1280, "height": 1024}
    projector = {"matrix": P, "distortion": DP[0], "resolution": PROJECTOR, "R": VECTOR, "T": T[:, 0]}
    path = as_json(tmp_path / "n.json", {"data": {"camera": camera, "projector": projector}})
    found = load_any_stereo(path)
    require_right(found)
    assert "data.projector.R is a rotation vector in radians" in found.taken


def test_a_pose_from_the_projector_is_turned_round(tmp_path: Path) -> None:
    back = {"R": R.T, "T": -R.T @ T}
    path = as_json(tmp_path / "b.json", {**PLAIN, **back})
    require_right(load_any_stereo(path, CAMERA, PROJECTOR, inverse=True), False)
    named = {"cam_K": K, "proj_K": P, "R_proj_to_cam": back["R"], "T_proj_to_cam": back["T"]}
    found = load_any_stereo(as_json(tmp_path / "c.json", named), CAMERA, PROJECTOR)
    require_right(found, False)
    assert "by its name, the pose leads from projector to camera" in found.taken


@pytest.mark.parametrize("name", ["cam2proj", "T_cam_to_proj", "proj2cam", "T_projector_to_camera"])
def test_a_pose_of_one_matrix_leads_where_its_name_says(tmp_path: Path, name: str) -> None:
    pose = np.vstack([np.hstack([R, T]), [0, 0, 0, 1]])
    is_back = name.index("p") < name.index("cam")
    parts = {"cam_K": K, "proj_K": P, name: np.linalg.inv(pose) if is_back else pose}
    found = load_any_stereo(as_json(tmp_path / "m.json", parts), CAMERA, PROJECTOR)
    require_right(found, False)
    assert ("by its name, the pose leads from projector to camera" in found.taken) == is_back


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"R": [1, 17, -1]}, "R is a rotation of 17.1 rad, more than half a turn"),
        ({"R": [1, 3, -0.5]}, "R is a rotation of 3.2 rad, more than half a turn"),
        ({"cam_K": K + np.diag([12.0, 0], 1)}, "cam_K is not a matrix of fx, fy, cx, cy"),
        ({"camera_resolution": [640, 512]}, "is for a camera of 640 x 512 px, not 1280 x 1024 px"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    with pytest.raises(CalibrationError, match=words):
        load_any_stereo(as_json(tmp_path / "c.json", {**PLAIN, **change}), CAMERA, PROJECTOR)


@pytest.mark.parametrize("name", ["size", "image_size"])
def test_the_size_of_a_board_is_that_of_no_camera(tmp_path: Path, name: str) -> None:
    parts = {**PLAIN, "board": {name: [9, 6]}, "pattern_size": [9, 6]}
    found = load_any_stereo(as_json(tmp_path / "c.json", parts), CAMERA, PROJECTOR)
    require_right(found, False)


def test_sizes_are_asked_for_and_doubted(tmp_path: Path) -> None:
    path = as_json(tmp_path / "c.json", PLAIN)
    with pytest.raises(CalibrationError, match=r"does not say the size of the camera\. Give --camera-size"):
        load_any_stereo(path, None, PROJECTOR)
    found = load_any_stereo(path, (640, 512), (400, 300))
    assert [each.split(")")[0] for each in found.doubts] == [
        "the camera's principal point (650, 500 px",
        "the projector's principal point (520, 760 px",
    ]


@pytest.mark.parametrize(
    ("camera", "projector", "doubted"),
    [
        ((0.5, 0.5), (0.5, 900.0), []),
        ((1279.5, 1023.5), (1023.5, -5.0), []),
        ((0.0, 500.0), (0.0, 380.0), ["camera", "projector"]),
        ((1280.0, 500.0), (1024.0, 380.0), ["camera", "projector"]),
        ((640.0, 0.0), (500.0, 380.0), ["camera"]),
        ((640.0, 1024.0), (500.0, 380.0), ["camera"]),
    ],
)
def test_a_principal_point_is_doubted_from_the_edge_of_the_picture_on(
    tmp_path: Path, camera: tuple[float, float], projector: tuple[float, float], doubted: list[str]
) -> None:
    lenses = {"cam_K": K.copy(), "proj_K": P.copy()}
    lenses["cam_K"][:2, 2], lenses["proj_K"][:2, 2] = camera, projector
    found = load_any_stereo(as_json(tmp_path / "c.json", PLAIN | lenses), (1280, 1024), (1024, 768))
    told = [each for each in found.doubts if "principal point" in each]
    assert [each.split("'")[0].removeprefix("the ") for each in told] == doubted


def test_a_camera_of_ros_alone_is_no_pair(tmp_path: Path) -> None:
    path = tmp_path / "head.yaml"
    data = f"{{rows: 3, cols: 3, data: {K.ravel().tolist()}}}"
    path.write_text(f"image_width: 1280\nimage_height: 1024\ncamera_matrix: {data}\n", encoding="utf-8")
    with pytest.raises(CalibrationError, match="lacks projector matrix and rotation and translation; it has"):
        load_any_stereo(path)
