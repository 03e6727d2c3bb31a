"""What a geometric calibration found, and how far to trust it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from dsl_core.model.base import Record
from dsl_core.model.board import Board
from dsl_core.model.geometry import Lens, Pose, Row3


class LensDeviation(Record):
    """Standard deviations of a lens's parameters."""

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, float, float, float, float]


class PoseDeviation(Record):
    """Standard deviations of the pose between camera and projector, about x, y, z and along them."""

    rotation_deg: Row3
    translation_mm: Row3


class Flatness(Record):
    """The corners of one pose, triangulated: sides of the squares, and distance from their best plane.

    ``bow_rms_mm`` is the smooth part of that distance, which is the board's shape; the rest is what corners
    are off by. None in records of before it was kept, and for so few corners that nothing tells both apart.
    """

    square_mm: float
    square_std_mm: float
    plane_rms_mm: float
    bow_rms_mm: float | None = None

    @property
    def shape_rms_mm(self) -> float:
        """What the board is not flat by, or at most so much."""
        return self.plane_rms_mm if self.bow_rms_mm is None else self.bow_rms_mm


class PoseQuality(Record):
    """Errors of one board pose; ``left_out`` is measured with a calibration that never saw it.

    Errors are rms lengths (two axes together) over the ``corners`` that were not ``outliers``. A pose that is
    not ``used`` did not fit the others. ``corners_px`` are columns and rows of all its corners in the camera
    image, to a hundredth; records of before they were kept have none.
    """

    name: str
    corners: int
    outliers: int
    used: bool
    camera_rms_px: float
    projector_rms_px: float
    distance_mm: float
    tilt_deg: float
    measured: Flatness
    left_out: Flatness | None = None
    corners_px: tuple[tuple[float, float], ...] = ()


class LeftOut(Record):
    """A pose that could not be used, or (``by_hand``) that a person did without, and why."""

    name: str
    reason: str
    by_hand: bool = False


class GeometryCalibration(Record):
    """Lenses and pose of camera and projector from a printed board, film off.

    ``rms_px`` is the rms over camera and projector errors together, without outliers. ``camera_binning`` is
    how many sensor pixels a camera pixel spans along a side: errors times it are errors at full resolution.
    Coverage is the share of an 8 x 8 grid of image cells that hold a corner. ``squares`` sums up all used
    poses; ``left_out`` are those whose board or code could not be read, or that a person left out.
    ``columns_only``: rows of the projector were not seen; fy, cy and ty of the projector are assumed, their
    deviations are those of the assumption, errors of the projector are those of columns, and its coverage is
    that of 8 strips.
    ``covariance``, row by row, is that of 24 parameters: fx, fy, cx, cy, k1, k2, p1, p2, k3 of the camera and
    of the projector, then rotation vector (rad) and translation (mm) of the pose; None where it is not known.
    """

    schema_version: Literal[1] = 1
    columns_only: bool = False
    board: Board
    camera: Lens
    projector: Lens
    pose: Pose
    camera_deviation: LensDeviation
    projector_deviation: LensDeviation
    pose_deviation: PoseDeviation
    covariance: tuple[float, ...] | None = None
    camera_rms_px: float
    projector_rms_px: float
    rms_px: float
    rms_with_outliers_px: float
    camera_binning: float = Field(default=1.0, gt=0)
    camera_coverage: float
    projector_coverage: float
    squares: Flatness
    poses: tuple[PoseQuality, ...]
    left_out: tuple[LeftOut, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def full_resolution_rms_px(self) -> float:
        """`rms_px` with camera errors in pixels of the unbinned sensor."""
        camera = self.camera_rms_px * self.camera_binning
        return float(((camera**2 + self.projector_rms_px**2) / 2) ** 0.5)

    @property
    def shape_rms_share(self) -> float:
        """Largest rms of what a board is not flat by, over the distance of its pose, of the used poses."""
        return max(pose.measured.shape_rms_mm / pose.distance_mm for pose in self.poses if pose.used)
