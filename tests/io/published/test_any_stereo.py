"""Calibrations of other programs are read by the names that their parts have."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.published.any_stereo import load_any_stereo
from dsl_core.io.published.stereo import Stereo, load_stereo, save_stereo
from dsl_core.io.published.stereo_rig import lenses_on
from tests.cases.small_rig import small_rig

CAMERA, PROJECTOR = (64, 48), (32, 24)
K_CAMERA: list[list[float]] = [[70.0, 0, 31], [0, 71, 23], [0, 0, 1]]
K_PROJECTOR: list[list[float]] = [[40.0, 0, 15], [0, 41, 20], [0, 0, 1]]
VECTOR = [0.0, 0.1, 0.0]
ROTATION = cv2.Rodrigues(np.array(VECTOR))[0].tolist()
SHIFT = [-120.0, 3, 4]
POSE, TURN = {"R": ROTATION, "T": SHIFT}, {"R": VECTOR, "t": SHIFT}


def _json(tmp_path: Path, content: dict[str, Any]) -> Path:
    path = tmp_path / "c.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "content",
    [
        {"cam_K": K_CAMERA, "proj_K": K_PROJECTOR, "R": ROTATION, "T": SHIFT},
        {
            "camera": {"K": K_CAMERA, "dist": [0.1, 0, 0, 0]},
            "projector": {"K": K_PROJECTOR},
            "R": VECTOR,
            "t": SHIFT,
        },
        {
            "cameraMatrix1": K_CAMERA,
            "distCoeffs1": [0.1, 0, 0, 0],
            "cameraMatrix2": K_PROJECTOR,
            "R": ROTATION,
            "T": SHIFT,
        },
        {
            "camera_matrix": K_CAMERA,
            "dist_coeffs": [0.1, 0, 0, 0],
            "projector_matrix": K_PROJECTOR,
            "R": ROTATION,
            "T": SHIFT,
        },
        {"M1": {"rows": 3, "data": K_CAMERA}, "M2": {"data": K_PROJECTOR}, "rmat": ROTATION, "tvec": SHIFT},
    ],
)
def test_common_names_are_known(tmp_path: Path, content: dict[str, Any]) -> None:
    found = load_any_stereo(_json(tmp_path, content), CAMERA, PROJECTOR)
    assert np.allclose(found.stereo.camera.matrix, K_CAMERA)
    assert np.allclose(found.stereo.projector.matrix, K_PROJECTOR)
    assert np.allclose(found.stereo.pose.matrix, ROTATION)
    assert found.stereo.pose.translation_mm == tuple(SHIFT)
    has_distortion = any("ist" in name for name in found.names.values())
    assert found.stereo.camera.distortion[0] == (0.1 if has_distortion else 0.0)
    assert ("no camera distortion" in found.assumed) != has_distortion


def test_files_of_opencv_are_read_with_any_names(tmp_path: Path) -> None:
    path = tmp_path / "c.yml"
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in (("K1", K_CAMERA), ("D1", [[0.1, 0, 0, 0]]), ("K2", K_PROJECTOR), ("R", ROTATION)):
        file.write(name, np.array(value))
    file.write("T", np.array(SHIFT)[:, None] / 1000)
    file.release()
    found = load_any_stereo(path, CAMERA, PROJECTOR, unit_mm=1000.0)
    assert np.allclose(found.stereo.pose.translation_mm, SHIFT)
    assert found.assumed == ("no projector distortion",)


def test_a_rig_of_lenses_alone_reaches_as_far_as_its_baseline_lets_it(tmp_path: Path) -> None:
    content = {"cam_K": K_CAMERA, "proj_K": K_PROJECTOR, "R": ROTATION, "T": SHIFT}
    rig = lenses_on(small_rig(), load_any_stereo(_json(tmp_path, content), CAMERA, PROJECTOR), "c.json")
    assert rig.depth_range_mm == pytest.approx((60.05, 6005), rel=1e-3)
    assert "depth alone; assumed: no camera distortion" in rig.provenance.notes


def test_what_is_missing_or_wrong_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        CalibrationError, match=r"lacks projector matrix and rotation; it has T, cam_K\. Name them"
    ):
        load_any_stereo(_json(tmp_path, {"cam_K": K_CAMERA, "T": SHIFT}), CAMERA, PROJECTOR)
    mirrored = {"cam_K": K_CAMERA, "proj_K": K_PROJECTOR, "R": np.diag([1.0, 1, -1]).tolist(), "T": SHIFT}
    with pytest.raises(CalibrationError, match="must be orthonormal and right-handed"):
        load_any_stereo(_json(tmp_path, mirrored), CAMERA, PROJECTOR)
    (tmp_path / "c.json").write_text('{"cam_K": [', encoding="utf-8")
    with pytest.raises(CalibrationError, match=r"c\.json is not a calibration that can be read"):
        load_any_stereo(tmp_path / "c.json", CAMERA, PROJECTOR)


@pytest.mark.parametrize("columns_only", [False, True])
def test_a_file_says_that_rows_were_not_seen(tmp_path: Path, columns_only: bool) -> None:
    rig = small_rig()
    stereo = Stereo(
        camera=rig.camera, projector=rig.projector, pose=rig.pose, rms_px=0.1, columns_only=columns_only
    )
    path = save_stereo(stereo, tmp_path / "stereo.yml")
    size = (rig.projector.width_px, rig.projector.height_px)
    found = load_any_stereo(path, projector_size_px=size)
    assert load_stereo(path, size).columns_only == found.stereo.columns_only == columns_only
    told = [sentence for sentence in found.doubts if "spectra through a film do not" in sentence]
    assert len(told) == columns_only
