"""Geometry: a printed board under Gray code in several poses, film off."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dsl_core.calibration.geometry.bundle import SHARED
from dsl_core.calibration.geometry.pose_series import MIN_POSES, exposure_warning, observe_series
from dsl_core.calibration.geometry.projector_corners import observe_pose
from dsl_core.calibration.geometry.solve import calibrate_geometry
from dsl_core.campaign.common.exposures import bracket, measure_white
from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.common.step_scan import is_complete, scan_of, scan_step
from dsl_core.campaign.geometry.board_look import look_at_board
from dsl_core.campaign.geometry.board_poses import default_poses
from dsl_core.errors import CalibrationError
from dsl_core.model.base import Record
from dsl_core.model.board import Board, Checkerboard
from dsl_core.model.calibration.geometry import GeometryCalibration, LeftOut
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.figure import Figure
from dsl_core.model.plan import CapturePlan, GrayCode, NoSpectral
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress

#: Limits of a good calibration, camera pixels of the unbinned sensor and projector pixels.
RMS_PX, PLANE_SHARE, SQUARE_SHARE, COVERAGE = 0.5, 5e-4, 0.005, 0.35


@dataclass(frozen=True)
class GeometryRecipe:
    """The calibration of both lenses and their pose.

    ``board`` is the printed board, its squares measured; ``poses`` how many of the proposed poses are taken.
    ``ratio`` is how much longer a second exposure is, 1 for none: ink reflects a twentieth of what paper
    does, which one exposure spans. ``left_out`` are keys of steps, such as ``pose-03``, that the fit does
    without; their captures are kept.
    """

    board: Board = field(default_factory=lambda: Checkerboard(columns=11, rows=7, square_mm=20.0))
    poses: int = 10
    ratio: float = 1.0
    left_out: tuple[str, ...] = ()

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
        """Whether the board is whole, sharp and not over-exposed, how it stands, and the room's light."""
        white = measure_white(bench.devices, bench.rig)
        return look_at_board(white, self.board, bench.rig, step.title)

    def is_captured(self, bench: Bench, step: Step) -> bool:
        """Whether the scan of the pose is complete."""
        return is_complete(bench.step_folder(step))

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Choose an exposure by a test shot and capture the code; a scan that was begun goes on.

        Raises `CalibrationError` naming the pose when the board or the code on it cannot be read, or white is
        saturated.
        """
        folder = bench.step_folder(step)
        plan = scan_step(bench.devices, folder, lambda: self._plan(bench, step), progress)
        frames = read_pose(folder, step.title, bench.rig)
        doubt = exposure_warning(frames, observe_pose(frames, self.board, plan.projector_size_px))
        if doubt:
            raise CalibrationError(doubt)

    def fit(self, bench: Bench, progress: Progress) -> GeometryCalibration:
        """Find the board on every pose and calibrate; poses that do not fit are left out by name."""
        every = self.steps(bench)
        unknown = set(self.left_out) - {step.key for step in every}
        if unknown:
            known = ", ".join(step.key for step in every)
            raise CalibrationError(
                f"There is no pose {', '.join(sorted(unknown))} to leave out; there are {known}."
            )
        steps = [step for step in every if step.key not in self.left_out]
        if len(steps) < MIN_POSES:
            raise CalibrationError(f"{len(steps)} poses are too few; {MIN_POSES} are needed, 10 are good.")
        unwanted = [
            LeftOut(name=step.title, reason="A person left it out.", by_hand=True)
            for step in every
            if step.key in self.left_out
        ]

        def pictures() -> Iterator[PoseFrames]:
            for index, step in enumerate(steps):
                progress.report("find the board", index, len(steps))
                yield read_pose(bench.step_folder(step), step.title, bench.rig)

        plan = scan_of(bench.step_folder(steps[0])).plan
        series = observe_series(pictures(), self.board, plan.projector_size_px)
        progress.report("adjust lenses and pose", 0, 1)
        record = calibrate_geometry(
            series.seen,
            self.board,
            plan.camera_size_px,
            plan.projector_size_px,
            baseline_mm=float(np.linalg.norm(bench.rig.pose.translation_mm)),
            left_out=(*series.left_out, *unwanted),
            warnings=series.warnings,
        )
        progress.report("adjust lenses and pose", 1, 1)
        return record

    def figures(self, record: Record) -> tuple[Figure, ...]:
        """Reprojection, planes, squares and coverage against their limits."""
        assert isinstance(record, GeometryCalibration)
        return geometry_figures(record)

    def apply(self, record: Record, rig: Rig) -> Rig:
        """The rig with both lenses, their pose, and how well they and zero-order columns are known."""
        assert isinstance(record, GeometryCalibration)
        known = rig.model_copy(
            update={
                "camera": record.camera,
                "projector": record.projector,
                "pose": record.pose,
                "geometry_covariance": record.covariance,
            }
        )
        return known.model_copy(update={"column_std_px": open_columns_px(known)})

    def _plan(self, bench: Bench, step: Step) -> CapturePlan:
        """The plan of a pose by a test shot."""
        white = measure_white(bench.devices, bench.rig)
        settings = bracket(bench.rig, white, f"The board of {step.title}", self.ratio)
        return CapturePlan(
            name=step.title,
            code=GrayCode(),
            spectral=NoSpectral(),
            settings=settings,
            code_settings=tuple(range(len(settings))),
        )


def open_columns_px(rig: Rig) -> float:
    """What the geometry's covariance leaves open in zero-order columns, px, rms over the image and depths."""
    from dsl_core.calibration.geometry.plane_refinement import systematic_std
    from dsl_core.calibration.geometry.stage_planes import covariance_root, shared_parameters

    if rig.geometry_covariance is None:
        return rig.column_std_px
    root = covariance_root(np.array(rig.geometry_covariance).reshape(SHARED, SHARED))
    return systematic_std(rig, shared_parameters(rig), root, np.eye(SHARED))[0]


def read_pose(folder: Path, name: str, rig: Rig) -> PoseFrames:
    """Pictures of a captured pose in linear light, all settings merged, black subtracted."""
    from dsl_core.reconstruction.merge import MergedScan

    reader = scan_of(folder)
    scan = MergedScan(reader, rig)
    pairs = [scan.merge("code", index).radiance for index in range(reader.plan.code_count)]
    white = scan.merge("white", 0)
    return PoseFrames(
        name,
        pairs,
        white.radiance,
        np.zeros_like(white.radiance),
        rig.sensor.bayer,
        white.variance,
        white.saturated,
    )


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
        Figure(
            name="doubts about poses and print",
            value=float(len(record.warnings)),
            unit="",
            high=0.0,
            advice=" ".join(record.warnings),
        ),
    )
