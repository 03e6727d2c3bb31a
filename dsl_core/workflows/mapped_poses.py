"""Pictures of board poses in any order and format, read by a mapping that all poses share."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.pictures.guess import Guess, guess_mapping
from dsl_core.io.pictures.mapping import Mapping
from dsl_core.io.pictures.source import PictureScan, open_pictures
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.captured_code import CapturedCode, Stripes
from dsl_core.model.plan import GrayCode
from dsl_core.model.rig import BayerPattern
from dsl_core.workflows.captures import decode_axes, sensor_of


def guess_poses(folders: list[Path], projector_size_px: tuple[int, int]) -> Guess:
    """How the pictures of the first pose are a capture, which the other poses have to be too.

    Raises `StoreError` when they make no sense, or leave open what a mapping must state.
    """
    guess = guess_mapping(folders[0], projector_size_px)
    if guess.asks:
        raise StoreError(f"{guess.asks}. State it in a mapping.")
    return guess


def read_mapped_pose(folder: Path, mapping: Mapping, bayer: BayerPattern | None = None) -> PoseFrames:
    """Pictures of one pose in the order of the Gray code, DN; a lacking inverse is what white leaves of it.

    Any other code, such as shifted sinusoids, is decoded. Raises `StoreError` naming pictures that are
    missing or wrong, and `CalibrationError` for a code of rows alone.
    """
    source = open_pictures(folder, mapping)
    white, black = (
        next(source.read(shot) for shot in source.plan.shots() if shot.role == role)
        for role in ("white", "black")
    )
    bayer = bayer or mapping.bayer
    kind = _kind(source)
    if kind == "decoded":
        places_px, std_px = decode_axes(source, sensor_of(source))
        return PoseFrames(folder.name, [], white, black, bayer, places_px=places_px, places_std_px=std_px)
    frames = [source.read(shot) for shot in source.plan.shots() if shot.role == "code"]
    pairs: list[NDArray[Any]] = list(frames)
    if kind == "without inverse":
        whole = white.astype(np.float32) + black
        pairs = [each for frame in frames for each in (frame.astype(np.float32), whole - frame)]
    return PoseFrames(folder.name, pairs, white, black, bayer)


def _kind(source: PictureScan) -> Literal["pairs", "without inverse", "decoded"]:
    """How a pose is read: Gray code by its grey values, any other decoded; raises `CalibrationError`."""
    code, size_px = source.plan.code, source.plan.projector_size_px
    if isinstance(code, GrayCode):
        return "pairs"
    if not isinstance(code, CapturedCode):
        return "decoded"
    if not code.column_sets:
        raise CalibrationError(
            f"The pictures of {source.root} show rows of the projector alone; lenses and pose are calibrated"
            " from columns, or from columns and rows. Capture vertical stripes too, or correct the mapping if"
            " these are columns."
        )
    plain = [(Stripes(bits=(length - 1).bit_length(), inverse=False, lacking=()),) for length in size_px]
    if code.column_sets == plain[0] and code.row_sets in ((), plain[1]):
        return "without inverse"
    return "decoded"
