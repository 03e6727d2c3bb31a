"""Pictures of board poses in any order and format, read by a mapping that all poses share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.io.pictures.guess import Guess, guess_mapping
from dsl_core.io.pictures.mapping import Mapping
from dsl_core.io.pictures.source import PictureScan, open_pictures
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.captured_code import CapturedCode, Stripes
from dsl_core.model.plan import GrayCode
from dsl_core.model.rig import BayerPattern


def guess_poses(folders: list[Path], projector_size_px: tuple[int, int]) -> Guess:
    """How the pictures of the first pose are a capture, which the other poses have to be too.

    Raises `StoreError` when they make no sense.
    """
    return guess_mapping(folders[0], projector_size_px)


def read_mapped_pose(folder: Path, mapping: Mapping, bayer: BayerPattern | None = None) -> PoseFrames:
    """Pictures of one pose in the order of the Gray code, DN; a lacking inverse is what white leaves of it.

    Raises `StoreError` naming pictures that are missing or wrong, and `CalibrationError` for another code
    than Gray code of all columns and rows.
    """
    source = open_pictures(folder, mapping)
    frames = [source.read(shot) for shot in source.plan.shots() if shot.role == "code"]
    white, black = (
        next(source.read(shot) for shot in source.plan.shots() if shot.role == role)
        for role in ("white", "black")
    )
    pairs: list[NDArray[Any]] = list(frames)
    if not _has_inverses(source):
        whole = white.astype(np.float32) + black
        pairs = [each for frame in frames for each in (frame.astype(np.float32), whole - frame)]
    return PoseFrames(folder.name, pairs, white, black, bayer or mapping.bayer)


def _has_inverses(source: PictureScan) -> bool:
    """Whether each picture of the Gray code is followed by its inverse; raises `CalibrationError`."""
    code, size_px = source.plan.code, source.plan.projector_size_px
    if isinstance(code, GrayCode) and code.rows:
        return True
    if isinstance(code, CapturedCode) and len(code.column_sets) == len(code.row_sets) == 1:
        sets = (*code.column_sets, *code.row_sets)
        plain = [Stripes(bits=(length - 1).bit_length(), inverse=False, lacking=()) for length in size_px]
        if sets == tuple(plain):
            return False
    raise CalibrationError(
        f"The pictures of {source.root} are not a Gray code of all {size_px[0]} columns and {size_px[1]} rows"
        " with every picture there, from which lenses and pose are calibrated. Capture the board under such a"
        " code, or correct the mapping."
    )
