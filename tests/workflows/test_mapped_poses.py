"""Pictures of a board in a stranger's order are those of the Gray code."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from dsl_core.calibration.geometry.projector_corners import observe_pose
from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.pictures.mapping import (
    BlackPicture,
    Mapping,
    PhasePictures,
    Skipped,
    StripePictures,
    WhitePicture,
)
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.workflows.mapped_poses import guess_poses, read_mapped_pose
from tests.cases.board_sets import BOARD, PROJECTOR_PX, board_set, phase_set
from tests.cases.foreign_captures import counted_sinusoids, write

ROWS_FIRST = (
    WhitePicture(),
    BlackPicture(),
    StripePictures(axis="rows", bits=7, inverse="none"),
    StripePictures(bits=7, inverse="none"),
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """White and black first, rows before columns, no inverses."""
    pose = board_set()[1]
    return write(
        tmp_path / "a", {f"{i}.bmp": p for i, p in enumerate([*pose[28:], *pose[14:28:2], *pose[:14:2]])}
    )


def test_the_first_pose_tells_the_order_of_all(folder: Path) -> None:
    assert guess_poses([folder], PROJECTOR_PX).mapping.parts == ROWS_FIRST


def test_what_the_first_pose_leaves_open_is_asked_for(tmp_path: Path) -> None:
    folder, _ = counted_sinusoids(tmp_path / "a")
    with pytest.raises(StoreError, match=r"must be known\. State it in a mapping"):
        guess_poses([folder], (160, 96))


def test_a_lacking_inverse_is_what_white_leaves(folder: Path) -> None:
    frames = read_mapped_pose(folder, Mapping(parts=ROWS_FIRST, projector_size_px=PROJECTOR_PX))
    pose = board_set()[1]
    assert len(frames.pairs) == 28
    assert np.array_equal(frames.white, pose[28])
    assert np.array_equal(frames.black, pose[29])
    for found, known in zip(frames.pairs, pose[:28], strict=True):
        assert np.abs(found - known.astype(float)).max() <= 2


def test_inverses_that_are_there_are_read(tmp_path: Path) -> None:
    pose = board_set()[1]
    turned = [p for k in range(0, 28, 2) for p in (pose[k + 1], pose[k])]
    folder = write(tmp_path, {f"{i:02d}.png": p for i, p in enumerate([*turned, *pose[28:]])})
    parts = [StripePictures(axis=a, bits=7, inverse_first=True) for a in ("columns", "rows")]
    mapping = Mapping(parts=(*parts, WhitePicture(), BlackPicture()), projector_size_px=PROJECTOR_PX)
    frames = read_mapped_pose(folder, mapping)
    assert all(np.array_equal(f, k) for f, k in zip(frames.pairs, pose[:28], strict=True))


def test_columns_alone_are_the_gray_code_of_columns(folder: Path) -> None:
    mapping = Mapping(
        files=("0.bmp", "1.bmp", "9.bmp", "1?.bmp"),
        parts=(WhitePicture(), BlackPicture(), ROWS_FIRST[3]),
        projector_size_px=PROJECTOR_PX,
    )
    frames = read_mapped_pose(folder, mapping)
    assert len(frames.pairs) == 14
    for found, known in zip(frames.pairs, board_set()[1][:14], strict=True):
        assert np.abs(found - known.astype(float)).max() <= 2


def test_rows_alone_are_refused(folder: Path) -> None:
    mapping = Mapping(
        files=("?.bmp",),
        parts=(WhitePicture(), BlackPicture(), ROWS_FIRST[2], Skipped(count=1)),
        projector_size_px=PROJECTOR_PX,
    )
    with pytest.raises(CalibrationError, match="show rows of the projector alone"):
        read_mapped_pose(folder, mapping)


@pytest.mark.slow
@pytest.mark.parametrize("axes", [("columns",), ("columns", "rows")])
def test_sinusoids_are_decoded_along_each_axis(
    tmp_path: Path, axes: tuple[Literal["columns", "rows"], ...]
) -> None:
    pictures = phase_set(*axes)[0]
    folder = write(tmp_path, {f"{i:02d}.png": picture for i, picture in enumerate(pictures)})
    parts = [PhasePictures(axis=axis, fringes=(1, 4, 16), steps=8) for axis in axes]
    mapping = Mapping(parts=(*parts, WhitePicture(), BlackPicture()), projector_size_px=PROJECTOR_PX)
    frames = read_mapped_pose(folder, mapping)
    assert not frames.pairs
    assert frames.places_px is not None
    assert frames.places_std_px is not None
    seen = observe_pose(frames, BOARD, PROJECTOR_PX)
    known = observe_pose(PoseFrames("gray", *_gray_frames()), BOARD, PROJECTOR_PX)
    assert len(frames.places_px) == len(axes)
    assert seen.columns_only == (axes == ("columns",))
    off = np.abs(seen.projector_px - known.projector_px)[:, : len(axes)]
    assert np.median(off) < 0.05
    assert off.max() < 0.15


def _gray_frames() -> tuple[Any, Any, Any]:
    *pairs, white, black = board_set()[0]
    return pairs, white, black
