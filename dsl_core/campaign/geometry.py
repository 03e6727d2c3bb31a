"""Geometry: a printed board under Gray code in several poses, film off."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dsl_core.calibration.geometric import calibrate_geometry
from dsl_core.calibration.geometry_diagnosis import exposure_warning
from dsl_core.calibration.projector_corners import PoseObservation, observe_pose
from dsl_core.calibration.targets import find_corners, grey_of
from dsl_core.campaign.board_poses import default_poses
from dsl_core.campaign.exposures import bracket, measure_white
from dsl_core.campaign.recipe import Bench, Step
from dsl_core.errors import CalibrationError
from dsl_core.io.session_manifest import MANIFEST_NAME
from dsl_core.io.session_reader import SessionReader
from dsl_core.model.base import Record
from dsl_core.model.board import Board, Checkerboard
from dsl_core.model.figure import Figure
from dsl_core.model.geometry_calibration import GeometryCalibration
from dsl_core.model.plan import CapturePlan, GrayCode, NoSpectral
from dsl_core.model.pose_frames import PoseFrames
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress

SCAN_NAME = "scan.dsl"
#: Limits of a good calibration, camera pixels of the unbinned sensor and projector pixels.
RMS_PX, PLANE_SHARE, SQUARE_SHARE, COVERAGE = 0.5, 5e-4, 0.005, 0.35
#: A board of fewer corners than this share in view says too little.
LEAST_CORNERS = 0.6
MOST_AMBIENT = 20.0


@dataclass(frozen=True)
class GeometryRecipe:
    """The calibration of both lenses and their pose.

    ``board`` is the printed board, its squares measured; ``poses`` how many of the proposed poses are taken.
    """

    board: Board = field(default_factory=lambda: Checkerboard(columns=11, rows=7, square_mm=20.0))
    poses: int = 10

    @property
    def name(self) -> str:
        """Name on the command line."""
        return "geometry"

    @property
    def title(self) -> str:
        """Title of the wizard."""
        return "Geometry"

    @property
    def needs(self) -> tuple[str, ...]:
        """Nothing; the self-test only gives better exposures."""
        return ()

    @property
    def record_type(self) -> type[Record]:
        """The record that `fit` makes."""
        return GeometryCalibration

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """A step for each pose."""
        found = default_poses(self.board, bench.rig, self.poses)
        return tuple(
            Step(f"pose-{i:02d}", f"Pose {i}", pose.instruction(bench.rig), pose.placement(self.board))
            for i, pose in enumerate(found, 1)
        )

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Whether the whole board is found, and how the room is."""
        white = measure_white(bench.devices, bench.rig)
        grey = grey_of(white.picture, bench.rig.sensor.bayer)
        corners = find_corners(grey, self.board, f"the test shot of {step.title}")
        total = int(np.prod(self.board.corner_grid))
        return (
            Figure(
                name="corners found",
                value=len(corners.ids),
                unit="",
                low=LEAST_CORNERS * total,
                high=total,
                advice="Move the board until all of it is in view and lit.",
            ),
            Figure(
                name="other light",
                value=100 * white.ambient,
                unit="% of white",
                high=MOST_AMBIENT,
                advice="Darken the room.",
            ),
        )

    def is_captured(self, bench: Bench, step: Step) -> bool:
        """Whether the scan of the pose is complete."""
        scan = bench.step_folder(step) / SCAN_NAME
        return (scan / MANIFEST_NAME).exists() and not SessionReader(scan).missing()

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Choose an exposure by a test shot and capture the code; a scan that was begun goes on."""
        from dsl_core import pipeline

        scan = bench.step_folder(step) / SCAN_NAME
        if (scan / MANIFEST_NAME).exists():
            plan = SessionReader(scan).plan
        else:
            white = measure_white(bench.devices, bench.rig)
            settings = bracket(bench.rig, white, f"The board of {step.title}", 1.0)
            plan = CapturePlan(
                name=step.title, code=GrayCode(), spectral=NoSpectral(), settings=settings, code_settings=(0,)
            )
            plan = pipeline.fit_plan(plan, bench.devices)
            scan.parent.mkdir(parents=True, exist_ok=True)
        pipeline.scan(bench.devices, plan, scan, progress)

    def fit(self, bench: Bench, progress: Progress) -> GeometryCalibration:
        """Find the board on every pose and calibrate; poses that do not fit are left out by name."""
        seen: list[PoseObservation] = []
        warnings: list[str] = []
        steps = self.steps(bench)
        size = (0, 0)
        for index, step in enumerate(steps):
            progress.report("find the board", index, len(steps))
            frames, size, projector = read_pose(bench.step_folder(step), step.title, bench.rig)
            try:
                seen.append(observe_pose(frames, self.board, projector))
            except CalibrationError as error:
                warnings.append(f"{step.title} is left out: {error}")
                continue
            doubt = exposure_warning(frames, seen[-1])
            warnings += [doubt] if doubt else []
        if len(seen) < max(3, len(steps) // 2):
            raise CalibrationError(
                f"Only {len(seen)} of {len(steps)} poses can be used. {' '.join(warnings)}"
                " Capture these poses anew."
            )
        progress.report("adjust lenses and pose", 0, 1)
        record = calibrate_geometry(seen, self.board, size, projector, warnings=warnings)
        progress.report("adjust lenses and pose", 1, 1)
        return record

    def figures(self, record: Record) -> tuple[Figure, ...]:
        """Reprojection, planes, squares and coverage against their limits."""
        assert isinstance(record, GeometryCalibration)
        return geometry_figures(record)

    def apply(self, record: Record, rig: Rig) -> Rig:
        """The rig with both lenses, their pose, and how well they are known."""
        assert isinstance(record, GeometryCalibration)
        return rig.model_copy(
            update={
                "camera": record.camera,
                "projector": record.projector,
                "pose": record.pose,
                "geometry_covariance": record.covariance,
            }
        )


def read_pose(folder: Path, name: str, rig: Rig) -> tuple[PoseFrames, tuple[int, int], tuple[int, int]]:
    """Pictures of a captured pose, and the sizes (width, height) of camera and projector."""
    reader = SessionReader(folder / SCAN_NAME)
    pictures = {
        role: [reader.read(shot) for shot in reader.plan.shots() if shot.role == role] for role in _ROLES
    }
    frames = PoseFrames(name, pictures["code"], pictures["white"][0], pictures["black"][0], rig.sensor.bayer)
    return frames, reader.plan.camera_size_px, reader.plan.projector_size_px


_ROLES = ("code", "white", "black")


def geometry_figures(record: GeometryCalibration) -> tuple[Figure, ...]:
    """Key figures of a geometric calibration."""
    squares, board = record.squares, record.board
    left_out = [pose.left_out.square_mm for pose in record.poses if pose.left_out]
    unseen = max((abs(side / board.square_mm - 1) for side in left_out), default=0.0)
    used = sum(pose.used for pose in record.poses)
    more = "Add poses that fill the picture, tilted in all directions, sharp and evenly lit."
    return (
        Figure(name="poses used", value=used, unit="", low=3, high=len(record.poses), advice=more),
        Figure(name="camera error", value=record.camera_rms_px, unit="px", high=RMS_PX, advice=more),
        Figure(name="projector error", value=record.projector_rms_px, unit="px", high=RMS_PX, advice=more),
        Figure(
            name="side of a square",
            value=squares.square_mm,
            std=squares.square_std_mm,
            unit="mm",
            low=board.square_mm * (1 - SQUARE_SHARE),
            high=board.square_mm * (1 + SQUARE_SHARE),
            advice="Measure the printed squares again.",
        ),
        Figure(
            name="squares of a pose left out, worst",
            value=100 * unseen,
            unit="%",
            high=100 * SQUARE_SHARE,
            advice=more,
        ),
        Figure(
            name="distance from a plane, of the distance",
            value=1e4 * record.plane_rms_share,
            unit="10⁻⁴",
            high=1e4 * PLANE_SHARE,
            advice="Use a flat, stiff board, and keep it still.",
        ),
        Figure(
            name="picture covered, camera",
            value=100 * record.camera_coverage,
            unit="%",
            low=100 * COVERAGE,
            advice=more,
        ),
        Figure(name="picture covered, projector", value=100 * record.projector_coverage, unit="%"),
    )
