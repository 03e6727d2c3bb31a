"""Calibration files of all dialects, of real ones where they are at hand."""

from __future__ import annotations

import os
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.published.stereo import (
    Dialect,
    Stereo,
    essential_matrix,
    fundamental_matrix,
    load_stereo,
    save_stereo,
)
from tests.cases.small_rig import small_rig

SHARED = Path(os.environ.get("DSL_SHARED", Path(__file__).parents[4] / "shared"))
REAL = SHARED / "data" / "procam_checkerboard" / "upstream_calibration_result.xml"


def _stereo(dialect: Dialect = "dsl") -> Stereo:
    rig = small_rig()
    return Stereo(camera=rig.camera, projector=rig.projector, pose=rig.pose, rms_px=0.365, dialect=dialect)


@pytest.mark.parametrize(
    ("dialect", "suffix"), [("dsl", ".xml"), ("procam", ".xml"), ("moreno-taubin", ".yml"), ("dsl", ".yml")]
)
def test_every_dialect_comes_back_to_the_last_digit(tmp_path: Path, dialect: Dialect, suffix: str) -> None:
    stereo = _stereo(dialect)
    path = save_stereo(stereo, tmp_path / f"calibration{suffix}")
    assert load_stereo(path, (640, 360), (890, 580)) == stereo


@pytest.mark.parametrize(
    ("dialect", "names"),
    [
        (
            "dsl",
            "img_shape rms cam_int cam_dist proj_int proj_dist rotation translation fundamental epipolar",
        ),
        ("procam", "img_shape rms cam_int cam_dist proj_int proj_dist roration translation"),
        ("moreno-taubin", "cam_K cam_kc proj_K proj_kc R T stereo_error"),
    ],
)
def test_nodes_are_named_as_other_programs_read_them(tmp_path: Path, dialect: Dialect, names: str) -> None:
    path = save_stereo(_stereo(dialect), tmp_path / "calibration.xml")
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert sorted(file.root().keys()) == sorted(names.split())
    translation = "T" if dialect == "moreno-taubin" else "translation"
    assert file.getNode(translation).mat().ravel().tolist() == [-54.98, -20.13, 21.86]
    if dialect == "dsl":
        assert file.getNode("img_shape").mat().ravel().tolist() == [580, 890]
        np.testing.assert_array_equal(file.getNode("cam_int").mat(), small_rig().camera.matrix)


def test_epipolar_geometry_holds_for_a_projected_point() -> None:
    stereo = _stereo()
    point = np.array([30.0, -20.0, 700.0])
    seen, lit = point, stereo.pose.matrix @ point + stereo.pose.vector_mm
    assert abs(lit @ essential_matrix(stereo.pose) @ seen) < 1e-6 * np.linalg.norm(lit) * np.linalg.norm(seen)
    camera_px = stereo.camera.matrix @ seen / seen[2]
    projector_px = stereo.projector.matrix @ lit / lit[2]
    fundamental = fundamental_matrix(stereo)
    assert fundamental[2, 2] == 1
    line = fundamental @ camera_px
    assert abs(projector_px @ line) / np.hypot(line[0], line[1]) < 1e-9  # px from the epipolar line


@pytest.mark.skipif(not REAL.is_file(), reason="the captures of procam_checkerboard are not at hand")
def test_a_real_calibration_file() -> None:
    stereo = load_stereo(REAL, (1024, 768))
    assert stereo.dialect == "procam"
    assert (stereo.camera.width_px, stereo.camera.height_px) == (1280, 1024)
    assert stereo.camera.fx_px == pytest.approx(3452.3929)
    assert stereo.projector.cy_px == pytest.approx(1357.82823)
    assert stereo.camera.distortion[4] == pytest.approx(3.12545966)
    assert stereo.pose.translation_mm[1] == pytest.approx(-630.457188)
    assert stereo.pose.rotation[2][1] == pytest.approx(-0.0787379614)
    assert stereo.rms_px == pytest.approx(0.856573)


def _edited(tmp_path: Path, old: str, new: str, dialect: Dialect = "dsl") -> Path:
    path = save_stereo(_stereo(dialect), tmp_path / "calibration.xml")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("rotation", "rotaton", r"rotation is missing \(is 'rotaton' misnamed\?\)"),
        ("cam_int", "kamera", r"'(dsl|procam)': .*cam_int is missing"),
        ("<rows>3</rows>", "<rows>1</rows>", "rotation is not a number or a complete matrix"),
        ("</opencv_storage>", "", "it is cut off or damaged"),
    ],
)
def test_wrong_files_name_the_node(tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(CalibrationError, match=says):
        load_stereo(_edited(tmp_path, old, new), (640, 360))


@pytest.mark.parametrize("content", ["", "hello", "<a><b></a>", '{"cam_int": 3', "\x00\x01\x02"])
def test_files_that_are_no_calibration(tmp_path: Path, content: str) -> None:
    path = tmp_path / "calibration.xml"
    path.write_text(content)
    with pytest.raises(CalibrationError, match=r"calibration\.xml is no"):
        load_stereo(path, (640, 360))


@pytest.mark.parametrize(
    ("node", "value", "says"),
    [
        ("T", np.array([1.0, np.nan, 2.0]), "T contains numbers that are not finite"),
        ("T", np.zeros(2), r"T has shape \(2,\), \(3,\) is needed for the translation"),
        ("R", 2 * np.eye(3), "pose.*orthonormal"),
        ("R", np.diag([1.0, 1.0, -1.0]), "pose.*right-handed"),
        ("cam_K", np.diag([-1.0, -1.0, 1.0]), "fx_px must be greater than 0"),
        (
            "cam_K",
            small_rig().camera.matrix + np.diag([60.0, 0], 1),
            "cam_K is not a matrix of fx, fy, cx, cy",
        ),
        ("proj_K", 2 * small_rig().projector.matrix, "proj_K is not a matrix of fx, fy, cx, cy"),
        ("cam_K", small_rig().camera.matrix.T, "cam_K is not a matrix of fx, fy, cx, cy"),
    ],
)
def test_wrong_values_are_refused(tmp_path: Path, node: str, value: NDArray[np.float64], says: str) -> None:
    _write(tmp_path / "calibration.xml", {node: value})
    with pytest.raises(CalibrationError, match=says):
        load_stereo(tmp_path / "calibration.xml", (640, 360), (890, 580))


@pytest.mark.parametrize("length", [3, 8])
def test_distortion_beyond_the_model_is_refused(tmp_path: Path, length: int) -> None:
    path = tmp_path / "calibration.xml"
    _write(path, {"cam_kc": np.full((1, length), 0.1)})
    with pytest.raises(CalibrationError, match=f"cam_kc has {length} distortion coefficients"):
        load_stereo(path, (640, 360), (890, 580))


def test_four_coefficients_and_trailing_zeros_are_taken(tmp_path: Path) -> None:
    path = tmp_path / "calibration.xml"
    for coefficients in ([0.1, 0.2, 0.3, 0.4], [0.1, 0.2, 0.3, 0.4, 0, 0, 0, 0]):
        _write(path, {"cam_kc": np.array([coefficients])})
        assert load_stereo(path, (640, 360), (890, 580)).camera.distortion == (0.1, 0.2, 0.3, 0.4, 0)


def _write(path: Path, changes: dict[str, NDArray[np.float64]]) -> None:
    rig = small_rig()
    nodes = {
        "cam_K": rig.camera.matrix,
        "cam_kc": np.zeros((1, 5)),
        "proj_K": rig.projector.matrix,
        "proj_kc": np.zeros((1, 5)),
        "R": rig.pose.matrix,
        "T": rig.pose.vector_mm,
    }
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in (nodes | changes).items():
        file.write(name, value)
    file.release()


def test_sizes_are_checked_and_asked_for(tmp_path: Path) -> None:
    path = save_stereo(_stereo(), tmp_path / "a.xml")
    with pytest.raises(CalibrationError, match=r"890 x 580 px, but 445 x 290 px are needed"):
        load_stereo(path, (640, 360), (445, 290))
    path = save_stereo(_stereo("moreno-taubin"), tmp_path / "b.yml")
    with pytest.raises(CalibrationError, match="does not contain the camera's image size"):
        load_stereo(path, (640, 360))
    with pytest.raises(CalibrationError, match="does not exist"):
        load_stereo(tmp_path / "c.xml", (640, 360))


def test_a_size_that_is_no_number_is_told(tmp_path: Path) -> None:
    text = save_stereo(_stereo("dsl"), tmp_path / "calibration.xml").read_text()
    node = re.search(r"<img_shape.*?<data>(.*?)</data>", text, re.DOTALL)
    assert node is not None
    path = tmp_path / "infinite.xml"
    path.write_text(text[: node.start(1)] + ".Inf 8." + text[node.end(1) :])
    with pytest.raises(CalibrationError, match=r"img_shape contains .*inf"):
        load_stereo(path, (640, 360))


def test_writing_is_careful(tmp_path: Path) -> None:
    path = save_stereo(_stereo(), tmp_path / "a.xml")
    with pytest.raises(StoreError, match="already exists"):
        save_stereo(_stereo("procam"), path)
    assert load_stereo(path, (640, 360)).dialect == "dsl"
    with pytest.raises(StoreError, match=r"\.xml or \.yml"):
        save_stereo(_stereo(), tmp_path / "a.txt")
