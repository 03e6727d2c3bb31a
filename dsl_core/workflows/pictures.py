"""Geometry from folders of pictures: one folder a board pose, pictures numbered in the order of the code."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.boards import grey_of
from dsl_core.calibration.geometry.camera_alone import CameraAlone, calibrate_camera
from dsl_core.calibration.geometry.pose_series import observe_series
from dsl_core.calibration.geometry.solve import calibrate_geometry as calibrate
from dsl_core.errors import CalibrationError
from dsl_core.io.pictures.mapping import Mapping as PictureMapping
from dsl_core.io.pictures.picture_file import MOST_BYTES
from dsl_core.io.png_parts import declares_too_much
from dsl_core.io.reading import read_bounded
from dsl_core.model.board import Board
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.plan import GrayCode
from dsl_core.model.rig import BayerPattern
from dsl_core.patterns.gray_code import bit_counts
from dsl_core.progress import NoProgress, Progress
from dsl_core.words import counted, natural
from dsl_core.workflows.mapped_poses import read_mapped_pose

SUFFIXES = {".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm"}


def calibrate_geometry(
    folder: Path,
    board: Board,
    projector_size_px: tuple[int, int],
    bayer: BayerPattern | None = None,
    camera_binning: float = 1.0,
    baseline_mm: float | None = None,
    progress: Progress | None = None,
    mapping: PictureMapping | None = None,
    hold: Collection[str] = (),
) -> GeometryCalibration:
    """Lenses and pose of camera and projector from folders of pictures, one per board pose, film off.

    Pictures are numbered in the order of the Gray code, with white and black last, unless a ``mapping`` says
    what each of them shows. Where the first pose has as many as columns alone need, rows are done without,
    see `GeometryCalibration`. Terms of distortion in ``hold`` (k1, k2, k3, tangential) are zero. Leaves out
    poses whose board or code cannot be read, and says so. Raises `CalibrationError` that names the picture
    that is missing, or the poses that are wrong when too few are left, and `StoreError` for pictures that do
    not fit the mapping.
    """
    progress = progress or NoProgress()
    folders = pose_folders(folder)
    columns, rows = bit_counts(GrayCode(), projector_size_px)
    bits = (columns, 0 if len(_pictures(folders[0])) == 2 * columns + 2 else rows)

    def pictures() -> Iterator[PoseFrames]:
        for index, pose_folder in enumerate(folders):
            progress.report("find the board", index, len(folders))
            if mapping is None:
                yield read_pose(pose_folder, bits, bayer)
            else:
                yield read_mapped_pose(pose_folder, mapping, bayer)

    return calibrate_poses(pictures(), board, projector_size_px, camera_binning, baseline_mm, hold)


def calibrate_poses(
    poses: Iterable[PoseFrames],
    board: Board,
    projector_size_px: tuple[int, int],
    camera_binning: float = 1.0,
    baseline_mm: float | None = None,
    hold: Collection[str] = (),
) -> GeometryCalibration:
    """Lenses and pose from the pictures of board poses, taken one by one; see `calibrate_geometry`.

    Raises `CalibrationError`.
    """
    sizes: dict[str, tuple[int, int]] = {}

    def of_one_size() -> Iterator[PoseFrames]:
        for frames in poses:
            sizes[frames.name] = (frames.white.shape[1], frames.white.shape[0])
            require_one_size(sizes)
            yield frames

    series = observe_series(of_one_size(), board, projector_size_px)
    return calibrate(
        series.seen,
        board,
        next(iter(sizes.values()), (0, 0)),
        projector_size_px,
        camera_binning=camera_binning,
        baseline_mm=baseline_mm,
        left_out=series.left_out,
        warnings=series.warnings,
        hold=hold,
    )


def calibrate_camera_alone(
    folder: Path,
    board: Board,
    bayer: BayerPattern | None = None,
    hold: Collection[str] = (),
    progress: Progress | None = None,
) -> CameraAlone:
    """The lens of a camera from pictures of a board in a folder, or the brightest of each pose folder.

    Terms of distortion in ``hold`` are zero. Raises `CalibrationError`.
    """
    progress = progress or NoProgress()
    if not folder.is_dir():
        raise CalibrationError(f"{folder} is not a folder. Give the folder that contains the pictures.")
    found = [[path] for path in _pictures(folder)] or [_pictures(each) for each in pose_folders(folder)]

    def greys() -> Iterator[tuple[str, NDArray[np.float32]]]:
        for index, paths in enumerate(found):
            progress.report("find the board", index, len(found))
            frame = max((_read(path) for path in paths), key=lambda picture: float(np.mean(picture)))
            yield (
                str(paths[0].relative_to(folder) if len(paths) == 1 else paths[0].parent.name),
                grey_of(frame, bayer),
            )

    return calibrate_camera(greys(), board, hold)


def pose_folders(folder: Path) -> list[Path]:
    """The folders of poses below a folder, by number; raises `CalibrationError` when there is none."""
    if not folder.is_dir():
        raise CalibrationError(
            f"{folder} is not a folder. Give the folder that contains one folder per pose."
        )
    found = _in_order(path for path in folder.iterdir() if path.is_dir() and _pictures(path))
    if not found:
        alone = len(_pictures(folder))
        instead = f" but {counted(alone, 'picture')}" if alone else ""
        raise CalibrationError(
            f"{folder} contains no folders with pictures{instead}. One folder per pose is needed, like"
            " capture_0 with graycode_00.png and so on: the board under every pattern of the code, then white"
            " and black. Pictures of a board without the code do not say where the projector is; they give"
            " the camera's lens (--camera-only)."
        )
    return found


def read_pose(folder: Path, bits: tuple[int, int], bayer: BayerPattern | None = None) -> PoseFrames:
    """Pictures of one pose: ``bits`` column and row bits as pattern and inverse each, then white, then black.

    Raises `CalibrationError` that names the picture that is missing, surplus, unreadable or of another size.
    """
    pictures, wanted = _pictures(folder), 2 * sum(bits) + 2
    _check_numbers(folder, pictures, wanted)
    frames = [_read(path) for path in pictures]
    for path, frame in zip(pictures, frames, strict=True):
        if frame.shape != frames[0].shape:
            raise CalibrationError(
                f"{path} is {_size(frame)} px, the first picture of its pose {_size(frames[0])} px."
                " Take all pictures with one setting of the camera."
            )
    return PoseFrames(folder.name, frames[:-2], frames[-2], frames[-1], bayer)


def require_one_size(sizes: Mapping[str, tuple[int, int]]) -> None:
    """Raise `CalibrationError` when the pictures of poses, by name, are not all of one size."""
    first, wanted = next(iter(sizes.items()))
    for name, size in sizes.items():
        if size != wanted:
            raise CalibrationError(
                f"The pictures of {name} are {size[0]} x {size[1]} px, those of {first}"
                f" {wanted[0]} x {wanted[1]}. All poses must be taken with one rig at one binning and crop."
            )


def _pictures(folder: Path) -> list[Path]:
    # Files that begin with a point are notes of a system, such as those of macOS on other disks.
    files = (path for path in folder.iterdir() if not path.name.startswith("."))
    return _in_order(path for path in files if path.suffix.lower() in SUFFIXES)


def _in_order(paths: Iterable[Path]) -> list[Path]:
    return sorted(paths, key=lambda path: natural(path.name))


def _check_numbers(folder: Path, pictures: list[Path], wanted: int) -> None:
    if len(pictures) == wanted:
        return
    numbers = [int(found[-1]) for path in pictures if (found := re.findall(r"\d+", path.stem))]
    absent = sorted(set(range(wanted)) - set(numbers))
    lacks = f" Number {', '.join(map(str, absent[:5]))} is missing." if absent and numbers else ""
    raise CalibrationError(
        f"{folder} contains {len(pictures)} pictures, {wanted} are needed: pattern and inverse of every bit"
        f" of the projector's columns and rows, white, black.{lacks} Correct the projector's size or add the"
        " pictures."
    )


def _read(path: Path) -> NDArray[Any]:
    import cv2

    # Through memory, because OpenCV cannot open every path on Windows.
    picture = None
    with contextlib.suppress(OSError, cv2.error):  # as for an empty file, or a size beyond OpenCV's limit
        data = read_bounded(path, MOST_BYTES)
        if not declares_too_much(data):
            picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise CalibrationError(f"{path} cannot be read as a picture. Copy it again, or leave its pose out.")
    return np.asarray(picture[..., :3] if picture.ndim == 3 else picture)


def _size(frame: NDArray[Any]) -> str:
    return f"{frame.shape[1]} x {frame.shape[0]}"
