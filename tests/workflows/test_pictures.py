"""Folders of pictures as strangers have them: with notes of their system, or without the code."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.png_parts import SIGNATURE
from dsl_core.workflows.pictures import calibrate_geometry, pose_folders, read_pose
from dsl_core.workflows.stacks import depth_of_columns
from tests.cases import board_sets
from tests.cases.foreign_captures import write

GREY = np.full((4, 6), 90, np.uint16)


def test_notes_of_a_system_are_no_pictures(tmp_path: Path) -> None:
    write(tmp_path / "capture_0", {f"graycode_{k:02d}.png": GREY + k for k in range(10)})
    (tmp_path / "capture_0" / "._graycode_00.png").write_bytes(b"\0")
    (tmp_path / "capture_0" / "Thumbs.db").write_bytes(b"\0")
    (tmp_path / "notes").mkdir()
    assert [folder.name for folder in pose_folders(tmp_path)] == ["capture_0"]
    frames = read_pose(tmp_path / "capture_0", (2, 2))
    assert (int(frames.white[0, 0]), int(frames.black[0, 0])) == (98, 99)


def test_boards_without_the_code_are_named(tmp_path: Path) -> None:
    write(tmp_path, {f"board{k}.png": GREY for k in range(3)})
    with pytest.raises(CalibrationError, match=r"but 3 pictures\. .* Pictures of a board without"):
        pose_folders(tmp_path)


HOLD = ("k1", "k2", "k3", "tangential")


@pytest.mark.slow
def test_pictures_of_columns_alone_are_recognised_and_give_depth(tmp_path: Path) -> None:
    for number, pose in enumerate(board_sets.columns_set()):
        write(tmp_path / f"capture_{number}", {f"g{i:02d}.png": each for i, each in enumerate(pose)})
    found = calibrate_geometry(tmp_path, board_sets.BOARD, board_sets.PROJECTOR_PX, hold=HOLD)
    assert found.columns_only
    assert found.projector.fx_px == pytest.approx(board_sets.PROJECTOR_FX_PX, rel=0.02)
    assert abs(found.projector.fx_px - board_sets.PROJECTOR_FX_PX) < 4 * found.projector_deviation.fx_px
    depth = depth_of_columns(found, board_sets.column_of_wall(600.0))
    assert np.nanmedian(depth) == pytest.approx(600.0, rel=0.005)


def test_a_pose_without_its_rows_is_named(tmp_path: Path) -> None:
    for number, pose in enumerate(board_sets.board_set()[:2]):
        kept = pose if number == 0 else (*pose[:14], *pose[28:])
        write(tmp_path / f"capture_{number}", {f"g{i:02d}.png": each for i, each in enumerate(kept)})
    with pytest.raises(CalibrationError, match="capture_1 contains 16 pictures, 30 are needed"):
        calibrate_geometry(tmp_path, board_sets.BOARD, board_sets.PROJECTOR_PX)


def test_a_picture_that_opencv_refuses_is_named(tmp_path: Path) -> None:
    size = struct.pack(">IIBBBBB", 40_000, 40_000, 16, 0, 0, 0, 0)
    parts = [(b"IHDR", size), (b"IDAT", zlib.compress(bytes(1000))), (b"IEND", b"")]
    coded = [
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in parts
    ]
    for index in range(4):
        (tmp_path / f"graycode_{index}.png").write_bytes(SIGNATURE + b"".join(coded))
    with pytest.raises(CalibrationError, match=r"graycode_0\.png cannot be read as a picture"):
        read_pose(tmp_path, (1, 0))
