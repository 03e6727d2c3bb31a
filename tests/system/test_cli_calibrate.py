"""``calibrate geometry --pictures`` on real pictures, and on folders that are not as they should be."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.published.stereo import load_stereo
from dsl_core.io.sealed import unseal
from dsl_core.model.calibration.geometry import GeometryCalibration
from tests.cases import board_sets
from tests.cases.board_poses import board_frames
from tests.cases.foreign_captures import write

from .conftest import Give

SHARED = Path(os.environ.get("DSL_SHARED", Path(__file__).resolve().parents[3] / "shared"))
REAL = SHARED / "data" / "procam_checkerboard" / "half_res"
SMALL = ["--pictures", "--board", "5x4", "--square-mm", 30, "--projector", "128x96"]


@pytest.mark.slow
@pytest.mark.skipif(not REAL.is_dir(), reason=f"the real captures are not in {REAL}")
def test_real_captures(give: Give, tmp_path: Path) -> None:
    """Published tools reach 0.40 px and 0.43 mm with the pictures at full resolution."""
    files = ["--output", tmp_path / "geometry.json", "--xml", tmp_path / "stereo.xml"]
    board = ["--board", "9x7", "--square-mm", 75, "--projector", "1024x768", "--binning", 2]
    ending = give("calibrate", "geometry", REAL, "--pictures", *board, *files, "--json")
    assert ending.code == 0, ending.err
    found = GeometryCalibration.model_validate_json(unseal((tmp_path / "geometry.json").read_bytes()))
    assert ending.json["calibration"] == found.model_dump(mode="json")
    assert found.full_resolution_rms_px <= 0.11
    assert found.rms_px <= 0.08
    assert found.rms_with_outliers_px <= 0.24
    assert found.squares.square_mm == pytest.approx(75.0, abs=0.03)
    assert found.squares.square_std_mm <= 0.1
    assert found.shape_rms_share <= 1e-4
    for pose in found.poses:
        assert pose.used
        assert pose.outliers <= 12
        assert pose.measured.square_mm == pytest.approx(75.0, abs=0.12)
        assert pose.left_out is not None
        assert abs(pose.left_out.square_mm / 75.0 - 1) <= 0.0015
    stereo = load_stereo(tmp_path / "stereo.xml", (1024, 768))
    np.testing.assert_allclose(stereo.pose.vector_mm, found.pose.vector_mm, rtol=1e-12)
    assert stereo.camera.fx_px == pytest.approx(found.camera.fx_px)


@pytest.mark.slow
@pytest.mark.skipif(not REAL.is_dir(), reason=f"the real captures are not in {REAL}")
def test_a_real_pose_without_a_board_is_left_out_and_said(give: Give, tmp_path: Path) -> None:
    for pose in range(4):
        home = tmp_path / "poses" / f"capture_{pose}"
        home.mkdir(parents=True)
        for picture in (REAL / home.name).iterdir():
            if (pose, picture.name) == (2, "graycode_40.png"):
                cv2.imwrite(str(home / picture.name), np.full((512, 640), 90, np.uint8))
            else:
                (home / picture.name).symlink_to(picture.resolve())
    board = ["--board", "9x7", "--square-mm", 75, "--projector", "1024x768", "--binning", 2]
    ending = give("calibrate", "geometry", tmp_path / "poses", "--pictures", *board, "--json")
    assert ending.code == 0, ending.err
    found = ending.json["calibration"]
    assert [each["name"] for each in found["left_out"]] == ["capture_2"]
    assert [pose["name"] for pose in found["poses"]] == [f"capture_{k}" for k in (0, 1, 3)]
    assert any("capture_2 is left out: The board" in warning for warning in found["warnings"])


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    for index in range(3):
        frames, home = board_frames(turn=0.1 * index), folder / f"capture_{index}"
        home.mkdir()
        for number, picture in enumerate([*frames.pairs, frames.white, frames.black]):
            cv2.imwrite(str(home / f"graycode_{number:02d}.png"), picture)
    return folder


def _cut(folder: Path) -> None:
    path = folder / "capture_1" / "graycode_05.png"
    path.write_bytes(path.read_bytes()[:40])


def _smaller(folder: Path) -> None:
    cv2.imwrite(str(folder / "capture_1" / "graycode_05.png"), np.zeros((90, 120), np.uint8))


def _smaller_pose(folder: Path) -> None:
    for path in (folder / "capture_1").iterdir():
        picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert picture is not None
        cv2.imwrite(str(path), cv2.resize(picture, None, fx=0.5, fy=0.5))


def _nothing(folder: Path) -> None:
    assert folder.is_dir()


def _emptied(folder: Path) -> None:
    for path in folder.iterdir():
        shutil.rmtree(path)


def _covered(folder: Path) -> None:
    cv2.imwrite(str(folder / "capture_1" / "graycode_28.png"), np.full((180, 240), 90, np.uint8))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        (lambda f: (f / "capture_1" / "graycode_05.png").unlink(), "Number 5 is missing"),
        (_cut, "graycode_05.png cannot be read as a picture"),
        (_smaller, "graycode_05.png is 120 x 90 px, the first picture of its pose 240 x 180"),
        (_smaller_pose, "pictures of capture_1 are 120 x 90 px, those of capture_0 240 x 180"),
        (_covered, "not found in the white picture of capture_1"),
        (_emptied, "contains no folders with pictures"),
        (lambda f: shutil.rmtree(f / "capture_2"), "2 usable poses of the board are too few"),
        (_nothing, "All poses of the board are nearly parallel"),
    ],
)
def test_what_is_wrong_is_named_and_nothing_written(
    give: Give, pictures: Path, tmp_path: Path, damage: Callable[[Path], object], sentence: str
) -> None:
    folder = Path(shutil.copytree(pictures, tmp_path / "pictures"))
    damage(folder)
    ending = give("calibrate", "geometry", folder, *SMALL, "--output", tmp_path / "geometry.json")
    assert ending.code == 2
    assert sentence in ending.sentence
    assert not (tmp_path / "geometry.json").exists()


def test_an_impossible_board_and_mosaic_are_told(give: Give, pictures: Path) -> None:
    assert "square_mm" in give("calibrate", "geometry", pictures, *SMALL, "--square-mm", -1).sentence
    assert "RGGB" in give("calibrate", "geometry", pictures, *SMALL, "--bayer", "XYZ").sentence
    assert "Correct the projector's size" in give(
        "calibrate", "geometry", pictures, *SMALL, "--projector", "640x360"
    ).sentence  # fmt: skip


@pytest.mark.slow
def test_pictures_of_a_board_in_any_order_are_guessed_and_give_the_camera_alone(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for k, pose in enumerate(board_sets.board_set()):
        named = [*pose[28:], *pose[14:28], *pose[:14]]
        write(tmp_path / f"pose{k}", {f"{i}.bmp": picture for i, picture in enumerate(named)})
    board = ["--pictures", "--board", "6x5", "--square-mm", 30, "--hold", "k3"]
    alone = give("calibrate", "geometry", tmp_path, *board, "--camera-only", "--json")
    assert alone.json["camera"]["fx_px"] == pytest.approx(board_sets.CAMERA_FX_PX, rel=0.03)
    assert alone.json["camera"]["distortion"][4] == 0

    def told(*given: Any) -> None:
        *_, mapping, hold = given
        raise CalibrationError(f"{[part.kind for part in mapping.parts]} {hold}")

    monkeypatch.setattr("dsl_core.workflows.pictures.calibrate_geometry", told)
    guessed = give("calibrate", "geometry", tmp_path, *board, "--projector", "128x96", "--guess")
    assert "Guessed from pose0: white; black; 7 bits of rows (gray, most significant first" in guessed.out
    assert guessed.sentence == "['white', 'black', 'stripes', 'stripes'] ['k3']"
    both = give("calibrate", "geometry", tmp_path, *board, "--guess", "--mapping", "m.json")
    assert "--guess finds out what --mapping states" in both.sentence
    files = give("calibrate", "geometry", tmp_path, *board, "--camera-only", "-o", "m.json")
    assert "--camera-only prints a lens" in files.sentence


@pytest.mark.slow
def test_sinusoids_of_columns_alone_are_guessed_and_what_is_assumed_is_printed(
    give: Give, tmp_path: Path
) -> None:
    for k, pose in enumerate(board_sets.phase_set("columns")):
        write(tmp_path / f"pose{k}", {f"{i:02d}.png": picture for i, picture in enumerate(pose)})
    holds = [word for term in ("k1", "k2", "k3", "tangential") for word in ("--hold", term)]
    board = ["--pictures", "--board", "6x5", "--square-mm", 30, "--projector", "128x96", "--guess", *holds]
    ending = give("calibrate", "geometry", tmp_path, *board)
    assert ending.code == 0, ending.err
    assert "3 sinusoids of columns in 8 steps" in ending.out
    assert ending.out.count("assumed") >= 2
    assert "Only columns of the projector were seen. Assumed of its rows: square pixels" in ending.out
