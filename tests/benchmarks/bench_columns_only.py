"""Calibration from columns alone: beside that with rows and the camera by itself, and what it costs.

    python -m tests.benchmarks.bench_columns_only [--quick] [--seeds 20] [--size 112x72]

First the real boards in ``$DSL_SHARED/data/procam_checkerboard``, if these are there: the lens of the camera
alone, columns only, columns and rows. ``planes`` are the corners of all boards triangulated, off their best
plane (mm, rms), ``depth`` how far corners are from where the calibration with rows puts them, for the same
columns (mm, rms). Then drawn rigs with noise: errors in stated deviations (rms; about 1 if these hold).
Last, scans of the twin reconstructed with numbers of the projector that columns do not tell set wrong.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dsl_core.calibration.geometry.bundle import triangulate
from dsl_core.calibration.geometry.pose_series import observe_series
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.calibration.geometry.solve import calibrate_geometry
from dsl_core.calibration.geometry.stage_planes import shared_parameters
from dsl_core.evaluation.verdict import figures
from dsl_core.model.board import Checkerboard
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.pipeline import evaluate, reconstruct
from dsl_core.workflows.pictures import calibrate_camera_alone, read_pose
from dsl_core.workflows.truths import twin_truth
from tests.benchmarks.common import options, print_table, write_json
from tests.cases import board_poses
from tests.cases.twin_scan import twin_scan

REAL_BOARD, REAL_PX = Checkerboard(columns=9, rows=7, square_mm=75.0), (1024, 768)
_LENS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
NAMES = (*_LENS, *(name.capitalize() for name in _LENS), "rx", "ry", "rz", "tx", "ty", "tz")
HEADS = ("fx", "cx", "cy", "Fx", "Cx", "Cy", "tx", "camera px", "projector px", "ty", "planes", "depth")
WRONG: dict[str, dict[str, float]] = {
    "as it is": {},
    "cy 20 px wrong": {"cy_px": -20},
    "cy 215 px wrong: the middle": {"cy_px": -215.4},
    "fy 1 % wrong": {"fy_px": 9.8},
    "ty 20 mm wrong": {"ty_mm": 20},
    "ty 75 mm wrong": {"ty_mm": 75},
}


def without_rows(poses: Sequence[PoseObservation]) -> list[PoseObservation]:
    """Observations of columns alone."""
    return [replace(p, projector_px=np.where([True, False], p.projector_px, np.nan)) for p in poses]


def real_boards() -> Iterator[tuple[str, ...]]:
    """A row each for the camera alone, columns only, and columns and rows."""
    root = Path(os.environ.get("DSL_SHARED", "../shared")) / "data" / "procam_checkerboard" / "half_res"
    if not root.is_dir():
        print(f"{root} is not there: real boards are left out.")
        return
    folders = sorted(root.resolve().iterdir())
    with tempfile.TemporaryDirectory() as home:
        for folder in folders:
            (Path(home) / f"{folder.name}.png").symlink_to(folder / "graycode_40.png")
        alone = calibrate_camera_alone(Path(home), REAL_BOARD)
    lens, std = alone.lens, alone.deviation
    yield (
        "camera alone",
        *_pm((lens.fx_px, std.fx_px), (lens.cx_px, std.cx_px), (lens.cy_px, std.cy_px)),
        *("-",) * 4,
        f"{alone.rms_px:.3f}",
        *("-",) * 4,
    )
    seen = observe_series((read_pose(folder, (10, 10)) for folder in folders), REAL_BOARD, REAL_PX).seen
    fits = [
        calibrate_geometry(poses, REAL_BOARD, (640, 512), REAL_PX) for poses in (seen, without_rows(seen))
    ]
    for name, found in (("columns only", fits[1]), ("columns and rows", fits[0])):
        yield (name, *_figures(found), f"{_apart_mm(found, fits[0], seen):.2f}")


def _pm(*values: tuple[float, float]) -> list[str]:
    return [f"{value:.1f}±{std:.1f}" for value, std in values]


def _figures(found: GeometryCalibration) -> list[str]:
    camera, projector = found.camera, found.projector
    c, p = found.camera_deviation, found.projector_deviation
    return [
        *_pm((camera.fx_px, c.fx_px), (camera.cx_px, c.cx_px), (camera.cy_px, c.cy_px)),
        *_pm((projector.fx_px, p.fx_px), (projector.cx_px, p.cx_px), (projector.cy_px, p.cy_px)),
        _pm((found.pose.translation_mm[0], found.pose_deviation.translation_mm[0]))[0],
        f"{found.camera_rms_px:.3f}",
        f"{found.projector_rms_px:.3f}",
        _pm((found.pose.translation_mm[1], found.pose_deviation.translation_mm[1]))[0],
        f"{found.squares.plane_rms_mm:.2f}",
    ]


def _apart_mm(
    found: GeometryCalibration, known: GeometryCalibration, seen: Sequence[PoseObservation]
) -> float:
    """How far apart in depth two calibrations put the corners, from their columns alone, mm rms."""
    start = [np.tile([0.0, 0.0, 3400.0], (len(pose.ids), 1)) for pose in seen]
    placed = [
        [
            triangulate(shared_parameters(each), pose, at)[:, 2]
            for pose, at in zip(without_rows(seen), start, strict=True)
        ]
        for each in (found, known)
    ]
    off = np.concatenate(placed[0]) - np.concatenate(placed[1])
    return float(np.sqrt(np.mean(off**2)))


def pulls(seeds: int) -> dict[str, float]:
    """Errors of all parameters of drawn rigs in their stated deviations, rms over seeds."""
    off = []
    for seed in range(seeds):
        poses = without_rows(board_poses.poses_seen(seed=seed))
        found = calibrate_geometry(poses, board_poses.BOARD, board_poses.CAMERA_PX, board_poses.PROJECTOR_PX)
        truth = found.model_copy(
            update={
                "camera": board_poses.CAMERA,
                "projector": board_poses.PROJECTOR,
                "pose": board_poses.POSE,
            }
        )
        assert found.covariance is not None
        covariance = np.asarray(found.covariance, np.float64).reshape(24, 24)
        std = np.sqrt(covariance.diagonal())
        off.append((shared_parameters(found) - shared_parameters(truth)) / std)
    rms = np.sqrt(np.mean(np.square(off), 0))
    return dict(zip(NAMES, rms.tolist(), strict=True))


def wrong_rows(size: str, quick: bool) -> Iterator[tuple[str, ...]]:
    """Depth and spectra of a scan of the twin, the numbers that columns do not tell set wrong."""
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=4))
    devices, scan = twin_scan(plan, size=size, scene="color-checker")
    rig, truth = devices.calibration, twin_truth(devices, WavelengthGrid())
    assert rig is not None
    assert truth is not None
    for name, wrong in list(WRONG.items())[: 2 if quick else None]:
        result = reconstruct(scan, _wrong(rig, **wrong))
        off_mm = float(np.nanmedian(np.abs(result["depth_mm"].values - truth.depth_mm)))
        found = figures(evaluate(result, truth))
        spectral = (found["spectral_rmse"], found["spectral_pixel_rmse"])
        yield (name, f"{off_mm:.3f}", *(f"{value:.4f}" for value in spectral))


def _wrong(rig: Rig, cy_px: float = 0.0, fy_px: float = 0.0, ty_mm: float = 0.0) -> Rig:
    lens, (tx, ty, tz) = rig.projector, rig.pose.translation_mm
    moved = lens.model_copy(update={"cy_px": lens.cy_px + cy_px, "fy_px": lens.fy_px + fy_px})
    pose = rig.pose.model_copy(update={"translation_mm": (tx, ty + ty_mm, tz)})
    return rig.model_copy(update={"projector": moved, "pose": pose})


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = options(__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--size", default="112x72")
    given = parser.parse_args(arguments)
    real = list(real_boards())
    print_table(("real boards (capitals: projector)", *HEADS), real)
    drawn = pulls(2 if given.quick else given.seeds)
    print_table(("drawn rigs: error / deviation", "rms"), [(k, f"{v:.2f}") for k, v in drawn.items()])
    twin = list(wrong_rows(given.size, given.quick))
    print_table(("twin", "depth mm", "spectra", "of pixels"), twin)
    write_json(given.json, {"real": real, "drawn": drawn, "twin": twin})


if __name__ == "__main__":
    main()
