"""Geometry: a printed board under Gray code in several poses, film off."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from dsl_core.calibration.geometry.bundle import SHARED
from dsl_core.calibration.geometry.pose_series import MIN_POSES, exposure_warning, observe_series
from dsl_core.calibration.geometry.projector_corners import observe_pose
from dsl_core.calibration.geometry.solve import calibrate_geometry
from dsl_core.campaign.common.bounds import Ratio
from dsl_core.campaign.common.recipe import Bench, Recipe, Step
from dsl_core.campaign.common.white_shot import bracket, shoot_white
from dsl_core.campaign.geometry.board_poses import default_poses
from dsl_core.campaign.geometry.board_size import BoardNote, fitting_board
from dsl_core.campaign.geometry.figures import geometry_figures, look_at_board
from dsl_core.errors import CalibrationError
from dsl_core.io.campaign_folder import SCAN_NAME
from dsl_core.io.records import read_record
from dsl_core.model.board import Board, Checkerboard
from dsl_core.model.calibration.geometry import GeometryCalibration, LeftOut
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.figure import Figure
from dsl_core.model.plan import CapturePlan, GrayCode, NoSpectral
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress

#: The board that nobody has chosen: a rig that places boards itself may get one with other squares.
USUAL_BOARD = Checkerboard(columns=11, rows=7, square_mm=20.0)
BOARD_NAME = "board.json"
#: More are no mistake of a board or a lens that ten do not show.
MOST_POSES = 99


@dataclass(frozen=True)
class GeometryRecipe(Recipe[GeometryCalibration]):
    """The calibration of both lenses and their pose.

    ``board`` is the printed board with its squares as measured, for a rig that places the usual one itself
    with squares that suit its view; ``poses`` is how many poses to capture.
    ``ratio`` is how many times longer a second exposure is, 1 for none: one exposure covers both paper and
    ink, which reflects a twentieth as much. ``left_out`` are the steps, such as ``pose-03``, that the fit
    leaves out; their captures are kept.
    """

    name = "geometry"
    title = "Geometry"
    record_type = GeometryCalibration

    board: Board = USUAL_BOARD
    poses: Annotated[int, Field(ge=MIN_POSES, le=MOST_POSES)] = 10
    ratio: Ratio = 1.0
    left_out: tuple[str, ...] = ()

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """A step for each pose."""
        board = self._board(bench)
        found = default_poses(board, bench.rig, self.poses)
        return tuple(
            Step(f"pose-{i:02d}", f"Pose {i}", pose.instruction(bench.rig), pose.placement(board))
            for i, pose in enumerate(found, 1)
        )

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Whether the board is whole, sharp and not over-exposed, how it stands, and the room's light."""
        white = shoot_white(bench)
        return look_at_board(white, self._board(bench), bench.rig, step.title, bench.found)

    def acts_at_capture(self, step: Step) -> dict[str, float]:
        """The second exposure."""
        return {"ratio": self.ratio}

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Choose an exposure by a test shot and capture the code; a scan that was begun continues.

        Raises `CalibrationError` naming the pose when the board or the code on it cannot be read, or white is
        saturated.
        """
        plan = bench.scan(step, lambda: self._plan(bench, step), progress)
        frames = read_pose(bench, step)
        doubt = exposure_warning(frames, observe_pose(frames, self._board(bench), plan.projector_size_px))
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
            LeftOut(name=step.title, reason="Left out by hand.", by_hand=True)
            for step in every
            if step.key in self.left_out
        ]

        def pictures() -> Iterator[PoseFrames]:
            for index, step in enumerate(steps):
                progress.report("find the board", index, len(steps))
                yield read_pose(bench, step)

        plan = bench.scan_of(steps[0]).plan
        board = self._board(bench)
        series = observe_series(pictures(), board, plan.projector_size_px)
        progress.report("adjust lenses and pose", 0, 1)
        record = calibrate_geometry(
            series.seen,
            board,
            plan.camera_size_px,
            plan.projector_size_px,
            baseline_mm=float(np.linalg.norm(bench.rig.pose.translation_mm)),
            left_out=(*series.left_out, *unwanted),
            warnings=series.warnings,
        )
        progress.report("adjust lenses and pose", 1, 1)
        return record

    def figures(self, record: GeometryCalibration, done: Collection[str] = ()) -> tuple[Figure, ...]:
        """Reprojection, planes, squares and coverage against their limits."""
        return geometry_figures(record)

    def apply(self, record: GeometryCalibration, rig: Rig) -> Rig:
        """The rig with both lenses, their pose, and how well they and zero-order columns are known."""
        known = rig.model_copy(
            update={
                "camera": record.camera,
                "projector": record.projector,
                "pose": record.pose,
                "geometry_covariance": record.covariance,
                "fitted_lean_px": None,
            }
        )
        return known.model_copy(update={"column_std_px": open_columns_px(known)})

    def _board(self, bench: Bench) -> Board:
        """The board that is placed: once one was captured, it stays that one."""
        if self.board != USUAL_BOARD or bench.devices.place is None:
            return self.board
        captured = sorted(each.parent for each in bench.folder.glob(f"pose-*/{SCAN_NAME}"))
        if captured:
            # Without a note it was captured when there was only one.
            note = captured[0] / BOARD_NAME
            return read_record(note, BoardNote).board if note.exists() else self.board
        return fitting_board(self.board, bench.rig, self.poses)

    def _plan(self, bench: Bench, step: Step) -> CapturePlan:
        """The plan of a pose by a test shot; keeps which board it is of."""
        bench.keep(step, BOARD_NAME, BoardNote(board=self._board(bench)))
        white = shoot_white(bench)
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


def read_pose(bench: Bench, step: Step) -> PoseFrames:
    """Pictures of a captured pose in linear light, all settings merged, black subtracted."""
    from dsl_core.reconstruction.merge import MergedScan

    reader = bench.scan_of(step)
    scan = MergedScan(reader, bench.rig)
    pairs = [scan.merge("code", index).radiance for index in range(reader.plan.code_count)]
    white = scan.merge("white", 0)
    return PoseFrames(
        step.title,
        pairs,
        white.radiance,
        np.zeros_like(white.radiance),
        bench.rig.sensor.bayer,
        white.variance,
        white.saturated,
    )
