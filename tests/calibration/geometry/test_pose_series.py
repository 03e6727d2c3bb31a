"""What poses of a board leave unsure is measured before the fit and said after it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.calibration.geometry.bundle import rotation_of
from dsl_core.calibration.geometry.common_view import wanted_coverage
from dsl_core.calibration.geometry.pose_series import (
    PoseSeries,
    _bent,
    _blurred,
    _check_axes,
    _corner_px,
    board_normal,
    check_poses,
    coverage,
    doubts,
    exposure_warning,
    largest_angle_deg,
    largest_tilt_deg,
    observe_series,
    picture_gamma,
)
from dsl_core.calibration.geometry.projector_corners import PoseObservation
from dsl_core.calibration.geometry.solve import calibrate_geometry
from dsl_core.errors import CalibrationError
from dsl_core.model.board import corner_positions_mm
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.optics.pinhole import project
from tests.cases import board_poses as case


@pytest.fixture(scope="module")
def found() -> GeometryCalibration:
    return calibrate_geometry(case.poses_seen(), case.BOARD, case.CAMERA_PX, case.PROJECTOR_PX)


def test_coverage_is_the_share_of_cells_with_a_corner() -> None:
    size = (80, 80)
    assert coverage(np.array([[5.0, 5.0], [6.0, 4.0], [15.0, 5.0]]), size) == pytest.approx(2 / 64)
    everywhere = np.stack(np.meshgrid(np.arange(80.0), np.arange(80.0)), -1).reshape(-1, 2)
    assert coverage(everywhere, size) == 1.0
    assert coverage(np.array([[-3.0, 5.0], [90.0, 5.0]]), size) == 0.0


def test_normals_come_from_corners_alone() -> None:
    board = corner_positions_mm(case.BOARD)
    turn = rotation_of(np.array([0.3, -0.2, 0.1]))
    points = board @ turn.T + [10.0, 20.0, 800.0]
    lens = case.CAMERA.model_copy(update={"distortion": (0.0,) * 5})
    matrix = np.array([[lens.fx_px, 0, lens.cx_px], [0, lens.fy_px, lens.cy_px], [0, 0, 1]])
    normal = board_normal(board, np.stack(project(lens, *points.T), 1), matrix, "pose")
    assert abs(normal @ turn[:, 2]) == pytest.approx(1.0, abs=1e-9)
    with pytest.raises(CalibrationError, match="one line"):
        board_normal(board[:9], np.stack([np.arange(9.0), np.zeros(9)], 1), matrix, "pose")


def test_the_largest_angle_is_that_of_two_planes() -> None:
    angles = np.radians([0.0, 20.0, -15.0])
    normals = np.stack([np.sin(angles), np.zeros(3), np.cos(angles)], 1) * [[1], [-1], [1]]
    assert largest_angle_deg(normals) == pytest.approx(35.0)
    # From corners, with a typical focal length instead of the true one.
    assert largest_tilt_deg(case.poses_seen(), case.CAMERA_PX) == pytest.approx(57.0, abs=12.0)


def test_poses_that_suffice_pass_and_doubts_name_what_is_poor(found: GeometryCalibration) -> None:
    check_poses(case.poses_seen(), case.CAMERA_PX)
    good = found.model_copy(update={"camera_coverage": 0.6, "projector_coverage": 0.6})
    assert not any("cover" in sentence for sentence in doubts(good, 40.0, None))
    poor = good.model_copy(
        update={
            "camera_coverage": 0.2,
            "rms_px": 0.8,
            "projector": found.projector.model_copy(update={"fy_px": 1.1 * found.projector.fx_px}),
            "camera_deviation": found.camera_deviation.model_copy(
                update={"fx_px": 0.05 * found.camera.fx_px}
            ),
            "poses": (found.poses[0].model_copy(update={"used": False}), *found.poses[1:]),
        }
    )
    sentences = doubts(poor, 10.0, None)
    for words in (
        "pose_0 does not fit",
        "Corners cover 20% of the camera's",
        "focal length of the camera is known only to 5.0%",
        "The projector seems to have oblong pixels",
        "reprojection error of 0.80 px is large",
        "tilted by 10 degrees at most",
    ):
        assert sum(words in sentence for sentence in sentences) == 1, words


def test_distortion_that_the_board_leaves_open_counts_in_the_corner(found: GeometryCalibration) -> None:
    lens = found.camera
    corner = np.hypot(
        max(lens.cx_px, lens.width_px - 1 - lens.cx_px) / lens.fx_px,
        max(lens.cy_px, lens.height_px - 1 - lens.cy_px) / lens.fy_px,
    )
    for px, told in ((2.0, True), (0.9, False)):
        covariance = np.diag(np.full(24, 1e-12))
        covariance[8, 8] = (px / (lens.fx_px * corner**7)) ** 2
        unsure = found.model_copy(update={"covariance": tuple(covariance.ravel().tolist())})
        sentences = [each for each in doubts(unsure, 40.0, None) if "distortion of the camera" in each]
        assert bool(sentences) == told
        assert not told or ": 2.0 px in a corner" in sentences[0]


@pytest.mark.parametrize(("coarse", "px", "told"), [(1.0, 1.8, True), (8.0, 1.8, False), (8.0, 3.0, True)])
def test_coarse_pictures_may_leave_more_open_in_the_projectors_corner(
    found: GeometryCalibration, coarse: float, px: float, told: bool
) -> None:
    lens = found.projector
    size_px = found.camera.width_px / coarse, found.camera.height_px / coarse
    camera = found.camera.resized(round(size_px[0]), round(size_px[1]))
    corner = np.hypot(
        max(lens.cx_px, lens.width_px - 1 - lens.cx_px) / lens.fx_px,
        max(lens.cy_px, lens.height_px - 1 - lens.cy_px) / lens.fy_px,
    )
    covariance = np.diag(np.full(24, 1e-12))
    covariance[17, 17] = (px / (lens.fx_px * corner**7)) ** 2
    changes = {"covariance": tuple(covariance.ravel().tolist()), "camera": camera}
    sentences = doubts(found.model_copy(update=changes), 40.0, None)
    assert any("distortion of the projector" in each for each in sentences) == told


def test_another_known_length_tells_a_wrong_printed_size(found: GeometryCalibration) -> None:
    baseline = float(np.linalg.norm(found.pose.translation_mm))
    assert not any("printed squares" in each for each in doubts(found, 40.0, 1.05 * baseline))
    (sentence,) = (each for each in doubts(found, 40.0, 1.2 * baseline) if "printed squares" in each)
    assert "probably 36.0 mm, not 30 mm" in sentence


@pytest.mark.parametrize("gamma", [1.0, 0.45])
def test_the_gamma_is_that_of_bright_places_where_stripes_cross_a_pixel(gamma: float) -> None:
    linear = case.board_frames()

    def pictured(picture: np.ndarray) -> np.ndarray:
        light = (picture - 4.0).clip(0) / 200.0
        # A camera that loses its darkest counts: dark squares would say nothing of its gamma.
        return np.asarray(1000 * np.where(light < 0.15, 0.0, light**gamma) + 10)

    frames = replace(
        linear,
        pairs=[pictured(picture) for picture in linear.pairs],
        white=pictured(linear.white) + np.where(linear.white < 40, 3.0, 0.0),
        black=pictured(linear.black),
    )
    assert picture_gamma(frames, case.SMALL_PROJECTOR_PX) == pytest.approx(gamma, abs=0.06)


def test_pictures_that_lose_the_light_of_stripes_have_a_gamma_of_eleven() -> None:
    linear = case.board_frames()
    finest = (case.SMALL_PROJECTOR_PX[0] - 1).bit_length() - 1
    pairs = list(linear.pairs)
    # Pattern and inverse together are no brighter than black.
    pairs[2 * finest : 2 * finest + 2] = [
        linear.black + 0.01 * (linear.white - linear.black),
        0 * linear.black,
    ]
    lost = replace(linear, pairs=pairs)
    assert picture_gamma(lost, case.SMALL_PROJECTOR_PX) == pytest.approx(1 + np.log2(1000), abs=0.01)


@pytest.mark.parametrize(("tilt_deg", "enough"), [(4.0, False), (7.0, True)])
def test_poses_five_degrees_apart_are_enough(tilt_deg: float, enough: bool) -> None:
    turn = np.radians(tilt_deg)
    tilts = ((0.0, 0.0), (turn, 0.0), (0.0, 0.0), (turn, 0.0), (0.0, 0.0), (turn, 0.0))
    poses = case.poses_seen(0.0, tilts=tilts)
    if enough:
        check_poses(poses, case.CAMERA_PX)
    else:
        with pytest.raises(CalibrationError, match="nearly parallel"):
            check_poses(poses, case.CAMERA_PX)


def pose_of(name: str, blur_px: float) -> PoseObservation:
    none = np.zeros((1, 2))
    return PoseObservation(name, np.zeros(1, np.int64), np.zeros((1, 3)), none, none, blur_px=blur_px)


@pytest.mark.parametrize(
    ("usual_px", "blur_px", "told"),
    [(1.0, 2.1, True), (1.0, 1.9, False), (0.3, 0.85, True), (0.3, 0.75, False)],
)
def test_a_pose_is_blurred_twice_as_much_as_others_and_visibly(
    usual_px: float, blur_px: float, told: bool
) -> None:
    series = [pose_of(str(k), usual_px) for k in range(4)] + [pose_of("odd", blur_px)]
    sentences = _blurred(series)
    assert [sentence.startswith("odd is blurred") for sentence in sentences] == [True] * told
    assert _blurred([]) == []


@pytest.mark.parametrize(("gamma", "told"), [(1.14, False), (1.16, True), (0.86, False), (0.84, True)])
def test_pictures_are_bent_from_a_gamma_off_by_fifteen_percent(gamma: float, told: bool) -> None:
    sentences = _bent(np.array([np.nan, gamma, gamma + 0.5, gamma - 0.5]))
    assert bool(sentences) == told
    assert not told or f"{gamma:.2f}" in sentences[0]
    assert _bent(np.array([np.nan])) == []


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ([[-1.0, 0.0], [0.0, 1.0]], "mirrored left to right"),
        ([[1.0, 0.0], [0.0, -1.0]], "mirrored top to bottom"),
        ([[0.0, 1.0], [1.0, 0.0]], "axes are swapped.* turned by a right angle, and one .* is mirrored"),
        ([[1.0, 0.0], [0.0, 1.0]], ""),
        ([[-1.0, 0.0], [0.0, -1.0]], ""),
    ],
)
def test_a_mirror_image_is_told_by_its_axis(axes: list[list[float]], words: str) -> None:
    camera = np.array([[0.0, 0.0], [100.0, 5.0], [0.0, 80.0], [90.0, 90.0]])
    projector = 0.7 * camera @ np.array(axes).T + [20.0, -3.0]
    good = PoseObservation("good", np.arange(4), np.zeros((4, 3)), camera, camera)
    odd = PoseObservation("odd", np.arange(4), np.zeros((4, 3)), camera, projector)
    if words:
        with pytest.raises(CalibrationError, match=f"In odd the images.*{words}"):
            _check_axes([good, odd])
    else:
        _check_axes([good, odd])


@pytest.mark.parametrize(("saturated", "told"), [(4, False), (5, True)])
def test_a_board_is_over_exposed_from_a_percent_of_its_pixels_on(
    monkeypatch: pytest.MonkeyPatch, saturated: int, told: bool
) -> None:
    # Corners from (10, 5) to (29, 24): 20 by 20 pixels, of which four are a percent.
    picture = np.ones((60, 60), bool)
    picture[5:25, 10:30] = False
    picture[5, 10 : 10 + saturated] = True
    monkeypatch.setattr("dsl_core.calibration.geometry.pose_series.saturated", lambda _: picture)
    corners = np.array([[10.4, 5.7], [29.2, 24.9], [12.0, 20.0]])
    pose = replace(pose_of("pose", 1.0), camera_px=corners)
    sentence = exposure_warning(replace(case.board_frames(), name="pose"), pose)
    assert (sentence is not None) == told
    assert sentence is None or "pose is over-exposed: 1%" in sentence


def test_fewer_than_three_poses_and_corners_that_are_not_finite_are_refused() -> None:
    poses = list(case.poses_seen())
    with pytest.raises(CalibrationError, match="2 usable poses"):
        check_poses(poses[:2], case.CAMERA_PX)
    with pytest.raises(CalibrationError, match=r"10 are good\. tilted could be read, but not by the"):
        check_poses(poses[:2], case.CAMERA_PX, ["tilted"])
    bad = replace(poses[1], projector_px=np.full_like(poses[1].projector_px, np.nan))
    with pytest.raises(CalibrationError, match=f"{bad.name} has corners that are not finite"):
        check_poses([poses[0], bad, *poses[2:]], case.CAMERA_PX)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"camera_coverage": 0.31}, {"camera_coverage": 0.29}),
        ({"projector_coverage": 0.31}, {"projector_coverage": 0.29}),
    ],
)
def test_both_sides_of_how_much_of_a_picture_corners_cover(
    found: GeometryCalibration, changes: dict[str, float], words: dict[str, float]
) -> None:
    good = found.model_copy(update={"camera_coverage": 0.6, "projector_coverage": 0.6})
    assert not any("cover" in each for each in doubts(good.model_copy(update=changes), 40.0, None))
    assert any("cover 29%" in each for each in doubts(good.model_copy(update=words), 40.0, None))


def test_corners_need_not_cover_what_the_other_device_does_not_see(found: GeometryCalibration) -> None:
    covered = found.model_copy(update={"camera_coverage": 0.6, "projector_coverage": 0.25})
    least = wanted_coverage(covered, 0.3)
    assert least == (0.3, 0.3)
    # A camera of thrice the focal length sees a ninth of the area.
    longer = {name: 3 * getattr(found.camera, name) for name in ("fx_px", "fy_px")}
    narrow = covered.model_copy(update={"camera": found.camera.model_copy(update=longer)})
    assert any("cover 25% of the projector" in each for each in doubts(covered, 40.0, None))
    assert not any("cover 25%" in each for each in doubts(narrow, 40.0, None))
    assert wanted_coverage(narrow, 0.3)[0] == 0.3
    assert 0.02 < wanted_coverage(narrow, 0.3)[1] < 0.12
    # What is lit of a picture is all that can be asked of the camera.
    lit = covered.model_copy(update={"projector": found.projector.model_copy(update={"width_px": 100})})
    assert wanted_coverage(lit, 0.35)[0] < 0.2


def test_both_sides_of_the_tilt_of_the_focal_length_and_of_the_error(found: GeometryCalibration) -> None:
    def told(words: str, tilt_deg: float = 40.0, **changes: object) -> bool:
        return any(words in each for each in doubts(found.model_copy(update=changes), tilt_deg, None))

    assert told("tilted by", 19.0)
    assert not told("tilted by", 21.0)
    assert told("reprojection error", rms_px=0.51)
    assert not told("reprojection error", rms_px=0.49)
    for share, expected in ((0.011, True), (0.009, False)):
        unsure = found.camera_deviation.model_copy(update={"fx_px": share * found.camera.fx_px})
        assert told("focal length of the camera is known only", camera_deviation=unsure) == expected


def series(monkeypatch: pytest.MonkeyPatch, *blurs: float | None, gamma: float = 1.0) -> PoseSeries:
    """Poses of these blurs; None: the board is not seen."""
    module = "dsl_core.calibration.geometry.pose_series."

    def observed(frames: Any, *_: Any) -> PoseObservation:
        if frames.blur is None:
            raise CalibrationError(f"{frames.name} shows no board.")
        return pose_of(frames.name, frames.blur)

    monkeypatch.setattr(module + "observe_pose", observed)
    monkeypatch.setattr(module + "picture_gamma", lambda *_: gamma)
    monkeypatch.setattr(
        module + "exposure_warning", lambda f, _: "too bright" if f.name == "pose 1" else None
    )
    poses: Any = [SimpleNamespace(name=f"pose {k}", blur=blur) for k, blur in enumerate(blurs)]
    return observe_series(poses, case.BOARD, case.PROJECTOR_PX)


def test_poses_without_a_board_are_left_out_and_named_before_all_doubts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = series(monkeypatch, 1.0, 1.0, None, 1.0, 3.0, gamma=0.5)
    assert [pose.name for pose in found.seen] == ["pose 0", "pose 1", "pose 3", "pose 4"]
    assert [each.name for each in found.left_out] == ["pose 2"]
    begin = [
        "too bright",
        "pose 2 is left out: pose 2 shows no board.",
        "pose 4 is blurred",
        "The pictures are",
    ]
    assert len(found.warnings) == 4
    assert all(each.startswith(words) for each, words in zip(found.warnings, begin, strict=True))


def test_stripes_that_lose_light_are_those_of_a_projector_that_scales_its_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (warning,) = series(monkeypatch, 1.0, 0.9, 1.0, gamma=1.4).warnings[1:]
    assert warning.startswith("Fine stripes give too little light, as if half of it had a gamma of 1.40")
    assert "keystone" in warning


def test_fewer_than_three_poses_are_refused_with_the_reasons_where_there_are_any(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert len(series(monkeypatch, 1.0, 1.0, None, 1.0).seen) == 3
    with pytest.raises(CalibrationError, match=r"Only 2 of 3 poses can be used, 3 are needed. pose 1 shows"):
        series(monkeypatch, 1.0, None, 1.0)
    # Nobody left anything out: who asked for two says what they lack.
    assert len(series(monkeypatch, 1.0, 1.0).seen) == 2


def test_where_no_pose_shows_the_board_the_first_is_searched_for_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    module = "dsl_core.calibration.geometry.pose_series."

    def none_seen(*_: Any) -> PoseObservation:
        raise CalibrationError("No board.")

    monkeypatch.setattr(module + "observe_pose", none_seen)
    monkeypatch.setattr(module + "grey_of", lambda white, _: white)
    monkeypatch.setattr(module + "other_board", lambda white, _: f" Another board in {white}.")
    poses: Any = [SimpleNamespace(name=name, white=f"white of {name}", bayer="RGGB") for name in "abc"]
    with pytest.raises(CalibrationError, match=r"3 are needed\. Another board in white of a\. No board\."):
        observe_series(poses, case.BOARD, case.PROJECTOR_PX)


def test_without_a_covariance_nothing_is_left_open_in_the_corners(found: GeometryCalibration) -> None:
    unknown = found.model_copy(update={"covariance": None})
    assert not any("distortion" in each for each in doubts(unknown, 40.0, None))
    assert _corner_px(unknown, unknown.camera, 0) == 0.0


def test_normals_are_judged_by_a_lens_of_one_and_a_half_widths_in_the_middle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = list[Any]()

    def noted(board: Any, camera: Any, matrix: Any, name: str) -> Any:
        asked.append(matrix.tolist())
        return np.array([0.0, 0.0, 1.0])

    monkeypatch.setattr("dsl_core.calibration.geometry.pose_series.board_normal", noted)
    assert largest_tilt_deg(case.poses_seen()[:1], (401, 201)) == 0.0
    assert largest_tilt_deg(case.poses_seen()[:1], (101, 201)) == 0.0
    assert asked[0] == [[601.5, 0, 200], [0, 601.5, 100], [0, 0, 1]]
    assert asked[1] == [[301.5, 0, 50], [0, 301.5, 100], [0, 0, 1]]


@pytest.mark.parametrize(("off", "told"), [(0.09, False), (0.11, True), (-0.09, False), (-0.11, True)])
def test_lengths_differ_from_ten_percent_on(found: GeometryCalibration, off: float, told: bool) -> None:
    baseline = float(np.linalg.norm(found.pose.translation_mm)) / (1 + off)
    assert any("mm apart, but" in each for each in doubts(found, 40.0, baseline)) == told


@pytest.mark.parametrize(("share", "told"), [(0.049, False), (0.051, True), (-0.051, True)])
def test_pixels_are_oblong_from_five_percent_on(found: GeometryCalibration, share: float, told: bool) -> None:
    lens = found.camera.model_copy(update={"fx_px": (1 + share) * found.camera.fy_px})
    odd = found.model_copy(update={"camera": lens})
    assert any("camera seems to have oblong" in each for each in doubts(odd, 40.0, None)) == told
