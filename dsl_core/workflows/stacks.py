"""Pictures and columns as arrays, without any files; `dsl_core.api.arrays` says what goes in and out."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ValidationError

from dsl_core.errors import CalibrationError, DecodeError
from dsl_core.model.base import problems_in_words
from dsl_core.model.board import Board
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.plan import CapturePlan, CodeSet, NoSpectral, Setting, Shot
from dsl_core.model.rig import BayerPattern, Rig
from dsl_core.workflows.captures import common_sensor, decode_columns_of

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class _Stack:
    """Arrays as a `FrameSource`: code, then white, then black."""

    plan: CapturePlan
    frames: NDArray[np.uint16]

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The frame of a shot."""
        return np.asarray(self.frames[shot.index])


def _grey(picture: ArrayLike) -> NDArray[np.number]:
    """A picture as numbers: true is white in pictures of one bit."""
    values = np.asarray(picture)
    return np.multiply(values, 255) if values.dtype == bool else values


def _columns_of(given: ArrayLike) -> NDArray[np.float64]:
    """Columns as numbers, NaN where they are masked; raises `DecodeError` for what are none."""
    try:
        # Not by asarray, which takes what is behind a mask for a column.
        return np.ma.filled(np.ma.asarray(given).astype(np.float64), np.nan)
    except (ValueError, TypeError) as error:
        raise DecodeError(
            "Columns are an array of numbers (rows, columns), such as column_px of a result; what was given"
            f" is of type {type(given).__name__}."
        ) from error


def decode_stack(
    pictures: Sequence[ArrayLike],
    code: CodeSet,
    projector_size_px: tuple[int, int],
    white: ArrayLike | None = None,
    black: ArrayLike | None = None,
) -> xr.Dataset:
    """What `dsl_core.api.arrays.decode_stack` says.

    Noise is that of a common sensor of 8 bits or, where values are larger, 16. Raises `DecodeError`.
    """
    arrays = [_grey(each) for each in pictures]
    if not arrays or any(each.ndim != 2 or each.shape != arrays[0].shape for each in arrays):
        shapes = ", ".join(sorted({str(each.shape) for each in arrays})) or "none"
        raise DecodeError(f"Pictures must be grey and of one size (rows, columns), given {shapes}.")
    stack = np.stack(arrays)
    lights = [
        stack.max(0) if white is None else _grey(white),
        stack.min(0) if black is None else _grey(black),
    ]
    if any(each.shape != stack.shape[1:] for each in lights):
        raise DecodeError(f"White and black must have the size of the pictures, {stack.shape[1:]}.")
    plan = _plan_of(stack.shape[1:], code, projector_size_px)
    if len(stack) != plan.code_count:
        raise DecodeError(
            f"The code has {plan.code_count} pictures, given {len(stack)}. Give all in its order."
        )
    frames = np.stack([*stack, *lights])
    if frames.min() < 0 or frames.max() > 65535 or (frames != np.rint(frames)).any():
        raise DecodeError("Pictures must hold whole numbers from 0 to 65535, as the camera gave them.")
    if frames[-2].mean() <= frames[-1].mean():
        raise DecodeError("White is not brighter than black. Give the pictures of both in this order.")
    sensor = common_sensor(8 if frames.max() < 256 else 16)
    return decode_columns_of(_Stack(plan, frames.astype(np.uint16)), sensor)


def _plan_of(shape: tuple[int, ...], code: CodeSet, projector_size_px: tuple[int, int]) -> CapturePlan:
    """A plan of nothing but a code, for pictures of ``shape`` (rows, columns); raises `DecodeError`."""
    try:
        return CapturePlan(
            name="stack",
            camera_size_px=(shape[1], shape[0]),
            projector_size_px=projector_size_px,
            code=code,
            spectral=NoSpectral(),
            settings=(Setting(exposure_ms=1.0, level=1.0),),
            code_settings=(0,),
        )
    except ValidationError as error:
        raise DecodeError(
            f"The stack cannot be decoded: {problems_in_words(error, 3, 'code and sizes')}. Correct it."
        ) from error


def calibrate_stacks(
    poses: Iterable[Sequence[ArrayLike]],
    board: Board,
    projector_size_px: tuple[int, int],
    bayer: BayerPattern | None = None,
    camera_binning: float = 1.0,
    baseline_mm: float | None = None,
    hold: Collection[str] = (),
) -> GeometryCalibration:
    """What `dsl_core.api.arrays.calibrate_geometry` says; errors name poses by numbers from 1.

    Raises `CalibrationError`.
    """
    from dsl_core.workflows.pictures import calibrate_poses

    def frames() -> Iterator[PoseFrames]:
        for number, pose in enumerate(poses, 1):
            if len(pose) < 3:
                raise CalibrationError(
                    f"Pose {number} has {len(pose)} pictures; pattern and inverse of every bit, white and"
                    " black are needed. Give all in this order."
                )
            *pairs, white, black = (np.asarray(picture) for picture in pose)
            yield PoseFrames(f"pose {number}", pairs, white, black, bayer)

    return calibrate_poses(frames(), board, projector_size_px, camera_binning, baseline_mm, hold)


def _rig_for_depth(found: GeometryCalibration) -> Rig:
    """Lenses and pose as a rig; all else of it means nothing."""
    from dsl_core.io.published.any_stereo import FoundStereo
    from dsl_core.io.published.stereo import stereo_of
    from dsl_core.io.published.stereo_rig import lenses_on
    from dsl_core.simulation.published_rig import published_rig

    return lenses_on(published_rig(), FoundStereo(stereo_of(found), {}, ()), "pictures of a board")


def depth_of_columns(calibration: Rig | GeometryCalibration, column_px: ArrayLike) -> NDArray[np.float64]:
    """What `dsl_core.api.arrays.depth_of_columns` says; raises `DecodeError` for another size.

    Raises `CalibrationError` for what is no calibration, such as the path of one.
    """
    import torch

    from dsl_core.optics.correspondence import triangulate

    if not isinstance(calibration, Rig | GeometryCalibration):
        raise CalibrationError(
            "A calibration is needed, as load_calibration and calibrate_geometry return it; what was given is"
            f" of type {type(calibration).__name__}."
        )
    rig = calibration if isinstance(calibration, Rig) else _rig_for_depth(calibration)
    column = _columns_of(column_px)
    if column.shape != (rig.camera.height_px, rig.camera.width_px):
        raise DecodeError(
            f"The columns have shape {column.shape}; the camera of {rig.name!r} has"
            f" {(rig.camera.height_px, rig.camera.width_px)} rows and columns."
        )
    depth = np.full(column.size, np.nan)
    known = np.flatnonzero(np.isfinite(column))
    found, _ = triangulate(rig, torch.as_tensor(known), torch.as_tensor(column.ravel()[known]))
    depth[known] = found.numpy()
    return depth.reshape(column.shape)
