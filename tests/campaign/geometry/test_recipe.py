"""The geometry of a drawn twin, from poses that its own hand takes; poses that are wrong are named."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.calibration.geometry.pose_series import observe_series, picture_gamma
from dsl_core.campaign.assembly import nominal_rig
from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.geometry.board_poses import default_poses, in_view
from dsl_core.campaign.geometry.recipe import GeometryRecipe, read_pose
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError
from dsl_core.model.board import Charuco, Checkerboard
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.geometry import Pose
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import project, rays_at
from dsl_core.progress import NoProgress
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import SimCamera, open_twin

#: Their fixtures calibrate a rig; `tests/campaign/test_kept_figures.py` calibrates one in any run.
pytestmark = pytest.mark.slow

BOARD = Checkerboard(columns=9, rows=6, square_mm=22.0)
RECIPE = GeometryRecipe(board=BOARD, poses=6)
CHARUCO = Charuco(columns=9, rows=6, square_mm=28, marker_mm=21)


def bench_at(folder: Path, **options: str) -> Bench:
    devices = open_twin({"size": "222x145", **options})
    return Bench(devices, folder, nominal_rig(devices))


def truth_of(devices: DeviceRig) -> Rig:
    assert isinstance(devices.camera, SimCamera)
    return devices.camera.world.rig


def take(recipe: GeometryRecipe, bench: Bench, step: Step, **changes: float) -> None:
    """Place the board of a step, changed where a test wants it, and capture it."""
    assert bench.devices.place is not None
    options = {**step.placement.options, **changes}
    bench.devices.place(Placement(target="board", film=False, options=options))
    recipe.capture(bench, step, NoProgress())


@pytest.fixture(scope="module")
def bench(module_folder: Path) -> Bench:
    """All poses of a drawn rig, captured."""
    found = bench_at(module_folder, truth="4")
    for step in RECIPE.steps(found):
        take(RECIPE, found, step)
    return found


@pytest.fixture(scope="module")
def record(bench: Bench) -> GeometryCalibration:
    return RECIPE.fit(bench, NoProgress())


@pytest.fixture(scope="module")
def poses(bench: Bench) -> list[PoseFrames]:
    return [read_pose(bench, step) for step in RECIPE.steps(bench)]


def columns(rig: Rig, depth_mm: float) -> NDArray[np.float64]:
    """Zero-order columns over the middle of the image."""
    x, y = np.meshgrid(np.linspace(20, 200, 10), np.linspace(15, 130, 7))
    points = rays_at(rig.camera, x.ravel(), y.ravel()) * depth_mm
    return np.asarray(project(rig.projector, *(rig.pose.matrix @ points + rig.pose.vector_mm[:, None]))[0])


def test_columns_of_the_drawn_rig_come_back(bench: Bench, record: GeometryCalibration) -> None:
    truth, found = truth_of(bench.devices), RECIPE.apply(record, bench.rig)
    for depth_mm in (600.0, 700.0, 850.0):
        off = columns(found, depth_mm) - columns(truth, depth_mm)
        nominal_off = columns(bench.rig, depth_mm) - columns(truth, depth_mm)
        assert np.sqrt((off**2).mean()) < 0.035  # six poses of coarse pixels
        assert np.sqrt((nominal_off**2).mean()) > 1.0
    assert 0.001 < found.column_std_px < 0.03
    assert found.geometry_covariance is not None


def test_a_pose_that_a_person_left_out_is_not_in_the_fit(bench: Bench, record: GeometryCalibration) -> None:
    found = replace(RECIPE, left_out=("pose-03",)).fit(bench, NoProgress())
    assert [pose.name for pose in found.poses] == ["Pose 1", "Pose 2", "Pose 4", "Pose 5", "Pose 6"]
    assert [(each.name, each.by_hand) for each in found.left_out] == [("Pose 3", True)]
    assert found.camera != record.camera
    assert all(RECIPE.is_captured(bench, step) for step in RECIPE.steps(bench))
    with pytest.raises(CalibrationError, match="There is no pose pose-99 to leave out; there are pose-01"):
        replace(RECIPE, left_out=("pose-99",)).fit(bench, NoProgress())
    with pytest.raises(CalibrationError, match="2 poses are too few"):
        replace(RECIPE, left_out=("pose-01", "pose-02", "pose-03", "pose-04")).fit(bench, NoProgress())


def test_corners_are_kept_to_show_what_they_cover(record: GeometryCalibration) -> None:
    for pose in record.poses:
        corners = np.array(pose.corners_px)
        assert corners.shape == (pose.corners, 2)
        assert ((corners > 0) & (corners < (222, 145))).all()


def test_figures_pass_and_say_how_good_it_is(record: GeometryCalibration) -> None:
    figures = {figure.name: figure for figure in RECIPE.figures(record)}
    assert all(figure.passed for figure in figures.values())
    assert figures["camera error"].value < 0.02
    assert figures["side of a square"].value == pytest.approx(22.0, abs=0.01)
    assert record.warnings == ()


def test_columns_that_tell_no_depth_are_named_at_once(record: GeometryCalibration) -> None:
    above = record.pose.model_copy(update={"translation_mm": (2.0, -120.0, 0.0)})
    made = record.model_copy(update={"pose": above})
    (missed,) = [figure for figure in RECIPE.figures(made) if not figure.passed]
    assert missed.name == "depth that a column stands for"
    assert "one above the other" in missed.advice
    assert "turn the projector and its film by 90°" in missed.advice


def test_a_look_tells_how_the_board_stands(bench: Bench) -> None:
    step = RECIPE.steps(bench)[1]
    assert bench.devices.place is not None
    bench.devices.place(step.placement)
    seen: list[NDArray[np.float64]] = []
    figures = {figure.name: figure for figure in RECIPE.look(replace(bench, found=seen.append), step)}
    assert all(figure.passed for figure in figures.values())
    assert figures["corners found"].value == 54
    assert [points_px.shape for points_px in seen] == [(54, 2)]
    assert ((seen[0] > 0) & (seen[0] < (222, 145))).all()
    tilts = [float(step.placement.options[f"tilt_{axis}_deg"]) for axis in "xy"]
    cosine = np.cos(np.radians(tilts[0])) * np.cos(np.radians(tilts[1]))
    assert figures["tilt"].value == pytest.approx(np.degrees(np.arccos(cosine)), abs=3)
    bench.devices.place(Placement(target="nothing", film=False))
    with pytest.raises(CalibrationError, match="test shot of Pose 2"):
        RECIPE.look(bench, step)


def test_a_board_half_out_of_view_is_refused_with_its_pose(tmp_path: Path) -> None:
    bench = bench_at(tmp_path)
    step = RECIPE.steps(bench)[2]
    with pytest.raises(CalibrationError, match="not found in the white picture of Pose 3"):
        take(RECIPE, bench, step, x_mm=160.0)


def test_a_pose_without_board_is_left_out_and_named(poses: list[PoseFrames]) -> None:
    blank = replace(poses[1], white=np.full_like(poses[1].white, 40.0))
    series = observe_series([poses[0], blank, *poses[2:]], BOARD, (640, 360))
    assert [pose.name for pose in series.seen] == ["Pose 1", "Pose 3", "Pose 4", "Pose 5", "Pose 6"]
    assert [each.name for each in series.left_out] == ["Pose 2"]
    assert any(w.startswith("Pose 2 is left out: The board of 9 x 6 inner corners") for w in series.warnings)
    with pytest.raises(CalibrationError, match=r"Only 2 of 3 poses can be used, 3 are needed. .* of Pose 2"):
        observe_series([poses[0], blank, poses[2]], BOARD, (640, 360))


def test_a_blurred_pose_is_named(poses: list[PoseFrames]) -> None:
    import cv2

    def soft(picture: NDArray[Any]) -> NDArray[Any]:
        # Over samples of one colour, as far apart as the mosaic has them.
        spread = np.zeros((5, 5), np.float32)
        spread[2, 2], spread[2, ::4], spread[::4, 2] = 0.4, 0.15, 0.15
        return np.asarray(cv2.filter2D(picture, -1, spread))

    moved = replace(poses[2], white=soft(poses[2].white), pairs=[soft(p) for p in poses[2].pairs])
    series = observe_series([*poses[:2], moved, poses[3]], BOARD, (640, 360))
    assert [w.split(":")[0] for w in series.warnings] == ["Pose 3 is blurred"]


def test_pictures_with_a_gamma_are_told(poses: list[PoseFrames]) -> None:
    def encoded(frames: PoseFrames) -> PoseFrames:
        top = float(frames.white.max())
        bent = [np.clip(p / top, 0, None) ** (1 / 2.2) for p in (*frames.pairs, frames.white, frames.black)]
        return replace(frames, pairs=bent[:-2], white=bent[-2], black=bent[-1])

    assert picture_gamma(poses[0], (640, 360)) == pytest.approx(1.0, abs=0.03)
    series = observe_series([encoded(frames) for frames in poses[:3]], BOARD, (640, 360))
    assert any("not linear: half the light corresponds to a gamma of 0.4" in w for w in series.warnings)


def test_a_wrong_printed_size_is_told_by_the_nominal_baseline(bench: Bench) -> None:
    wrong = replace(RECIPE, board=BOARD.model_copy(update={"square_mm": 27.5}))
    # The captures are those of the true board; only what the recipe believes of it differs.
    found = replace_steps(wrong).fit(bench, NoProgress())
    assert any("the printed squares are probably 2" in w for w in found.warnings)


def replace_steps(recipe: GeometryRecipe) -> GeometryRecipe:
    """A recipe that proposes the poses of the right board."""

    class Same(GeometryRecipe):
        def steps(self, bench: Bench) -> tuple[Step, ...]:
            return RECIPE.steps(bench)

    return Same(recipe.board, recipe.poses)


def test_two_settings_are_merged(tmp_path: Path) -> None:
    bench = bench_at(tmp_path)
    recipe = replace(RECIPE, ratio=6.0)
    step = recipe.steps(bench)[0]
    take(recipe, bench, step)
    manifest = json.loads((bench.step_folder(step) / "scan.dsl" / "manifest.json").read_text())
    assert len(manifest["plan"]["settings"]) == 2
    frames = read_pose(bench, step)
    assert frames.saturated is not None
    assert frames.variance is not None
    assert not frames.saturated.any()
    assert len(observe_series([frames] * 3, BOARD, (640, 360)).seen) == 3


@pytest.mark.parametrize(
    "board",
    [
        BOARD,
        Checkerboard(columns=11, rows=7, square_mm=20),
        Charuco(columns=9, rows=6, square_mm=28, marker_mm=21),
    ],
)
def test_both_devices_see_the_whole_board_in_every_pose(board: Checkerboard | Charuco) -> None:
    poses = default_poses(board, published_rig(), 12)
    assert len(poses) == 12
    assert all(in_view(pose, board, published_rig()) for pose in poses)
    assert np.ptp([pose.depth_mm for pose in poses]) > 150
    assert max(abs(pose.tilt_x_deg) for pose in poses) >= 35
    assert "lower edge tilted away by about 35°" in poses[1].instruction(published_rig())
    assert "about 75 cm in front of the camera" in poses[1].instruction(published_rig())


def test_a_board_too_large_is_refused() -> None:
    with pytest.raises(CalibrationError, match="A board of 800 x 560 mm is too large"):
        default_poses(Checkerboard(columns=9, rows=6, square_mm=80), published_rig(), 5)


def test_devices_described_as_looking_past_each_other_are_named_instead_of_the_board() -> None:
    rig = published_rig()
    aside = rig.pose.model_copy(update={"translation_mm": (350.0, 0.0, 0.0)})
    with pytest.raises(CalibrationError, match=r"projector lights \d+% of the camera.*correct the pose"):
        default_poses(BOARD, rig.model_copy(update={"pose": aside}), 5)


def aside(shift: tuple[float, float], baseline_mm: float | None = None) -> Rig:
    """Lenses without distortion, the projector's shifted by shares of its picture; or with parallel axes."""
    rig = published_rig()
    straight = {"distortion": (0.0,) * 5, "cx_px": rig.projector.cx_px + 640 * shift[0]}
    lens = rig.projector.model_copy(update={**straight, "cy_px": rig.projector.cy_px + 360 * shift[1]})
    parallel = Pose(rotation=((1, 0, 0), (0, 1, 0), (0, 0, 1)), translation_mm=(baseline_mm or 0.0, 0, 0))
    return rig.model_copy(update={"projector": lens, "pose": parallel if baseline_mm else rig.pose})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "square_mm"),
    [
        (aside((0.3, 0)), 15.0),
        (aside((0, 0.45)), 15.0),
        (aside((0, 0), 100.0), 8.0),
        (aside((0, 0), 250.0), 8.0),
    ],
)
def test_boards_go_where_both_devices_see_them_however_far_aside(rig: Rig, square_mm: float) -> None:
    board = Checkerboard(columns=9, rows=6, square_mm=square_mm)
    poses = default_poses(board, rig, 6)
    assert all(in_view(pose, board, rig) for pose in poses)
    # Poses that differ in their wished place differ in their place, as far as there is room.
    left, right = poses[1].x_mm, poses[2].x_mm
    upper, lower = poses[1].y_mm, poses[3].y_mm
    assert left < right
    assert upper < lower
    with pytest.raises(CalibrationError, match="does not fit into the view of camera and projector"):
        default_poses(Checkerboard(columns=9, rows=6, square_mm=3 * square_mm), rig, 6)


def test_boards_stand_at_the_depths_that_the_rig_is_for() -> None:
    near = published_rig().model_copy(update={"depth_range_mm": (300.0, 420.0)})
    poses = default_poses(Checkerboard(columns=6, rows=4, square_mm=8), near, 12)
    assert all(324 <= pose.depth_mm <= 384 for pose in poses)
