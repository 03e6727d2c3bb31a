"""Folders of pictures as strangers have them: with notes of their system, or without the code."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.workflows.pictures import pose_folders, read_pose
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
