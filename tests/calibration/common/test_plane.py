"""The plane of a target is found through rounded columns and in spite of what stands before it."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.common.plane import _near_first_plane, bulge_figure, bulge_mm, fit_plane
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.shading import Plane
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.robust import robust_std

#: 700 mm away, turned by some degrees about both axes.
PLANE = Plane(np.array([0.12, -0.07, 1.0]) / 700.0)


@pytest.fixture(scope="module")
def rig() -> Rig:
    rig = published_rig()
    return rig.model_copy(update={"camera": rig.camera.resized(112, 72)})


def seen(rig: Rig, noise: float = 1e-3) -> np.ndarray:
    """Depths whose inverse is off by a share, with a box a fifth nearer in one corner."""
    depth = PLANE.depth_mm(rig) / (1 + noise * np.random.default_rng(0).standard_normal((72, 112)))
    depth[:10, :14] *= 0.8
    return np.asarray(depth)


def test_a_plane_is_found_and_what_stands_before_it_left_out(rig: Rig) -> None:
    found = fit_plane(rig, seen(rig), np.ones((72, 112), bool))
    assert found.plane.distance_mm == pytest.approx(700.0, abs=0.05)
    assert found.plane.tilt_deg == pytest.approx(PLANE.tilt_deg, abs=0.02)
    assert not found.on_plane[:10, :14].any()
    assert found.on_plane[10:].mean() > 0.99
    assert found.rms_mm == pytest.approx(0.7, rel=0.05)


@pytest.mark.parametrize("nearer", [0.5, 0.7, 0.9, 1.6])
def test_outliers_in_a_corner_do_not_draw_the_plane(rig: Rig, nearer: float) -> None:
    depth = seen(rig)
    depth[:20, :29] = nearer * PLANE.depth_mm(rig)[:20, :29]  # 7 % of all pixels
    found = fit_plane(rig, depth, np.ones((72, 112), bool))
    assert found.plane.distance_mm == pytest.approx(700.0, abs=0.1)
    assert not found.on_plane[:20, :29].any()


def test_depths_that_are_unknown_or_unusable_do_not_count(rig: Rig) -> None:
    depth, usable = seen(rig), np.ones((72, 112), bool)
    depth[40:, ::3] = np.nan
    depth[30:40], usable[30:40] = 300.0, False
    found = fit_plane(rig, depth, usable)
    assert found.plane.distance_mm == pytest.approx(700.0, abs=0.05)
    assert not found.on_plane[30:40].any()


def test_the_start_says_which_of_two_planes_is_meant(rig: Rig) -> None:
    depth, start = seen(rig), np.zeros((72, 112), bool)
    depth[:, 40:] = 0.8 * PLANE.depth_mm(rig)[:, 40:]
    start[30:60, 5:35] = True
    found = fit_plane(rig, depth, np.ones((72, 112), bool), start)
    assert found.plane.distance_mm == pytest.approx(700.0, abs=0.1)


def test_too_few_pixels_and_a_line_of_pixels_are_refused(rig: Rig) -> None:
    usable = np.zeros((72, 112), bool)
    usable[:5, :10] = True
    with pytest.raises(CalibrationError, match="Only 50 pixels"):
        fit_plane(rig, PLANE.depth_mm(rig), usable)
    usable[:] = False
    usable[30:32, :] = True
    with pytest.raises(CalibrationError, match="form a line"):
        fit_plane(rig, PLANE.depth_mm(rig), usable)


@pytest.mark.parametrize(("pixels", "enough"), [(200, True), (199, False)])
def test_two_hundred_pixels_are_enough(rig: Rig, pixels: int, enough: bool) -> None:
    usable = np.zeros((72, 112), bool)
    usable[20:40:2, 10:110:5] = True
    usable[np.unravel_index(np.flatnonzero(usable)[pixels:], usable.shape)] = False
    depth = PLANE.depth_mm(rig)
    if enough:
        assert fit_plane(rig, depth, usable).plane.distance_mm == pytest.approx(700.0)
    else:
        with pytest.raises(CalibrationError, match="Only 199 pixels"):
            fit_plane(rig, depth, usable)


@pytest.mark.parametrize(
    ("share", "on_plane"), [(0.011, True), (0.013, False), (-0.011, True), (-0.013, False)]
)
def test_without_noise_a_pixel_is_on_the_plane_within_a_little_more_than_a_percent(
    rig: Rig, share: float, on_plane: bool
) -> None:
    depth = PLANE.depth_mm(rig)
    depth[40, 50] /= 1 + share
    depth[40, 50] = PLANE.depth_mm(rig)[40, 50] * (1 + share)
    assert fit_plane(rig, depth, np.ones((72, 112), bool)).on_plane[40, 50] == on_plane


@pytest.mark.parametrize(("sigmas", "on_plane"), [(3.7, True), (4.3, False)])
def test_with_noise_it_is_within_four_deviations(rig: Rig, sigmas: float, on_plane: bool) -> None:
    noise = 0.01 * np.random.default_rng(0).standard_normal((72, 112))
    noise[40, 50] = 0.01 * sigmas
    depth = PLANE.depth_mm(rig) * (1 + noise)
    assert fit_plane(rig, depth, np.ones((72, 112), bool)).on_plane[40, 50] == on_plane


@pytest.mark.parametrize(("rows", "is_wide"), [(1, False), (3, True)])
def test_pixels_have_to_spread_by_a_fiftieth_of_their_extent(rig: Rig, rows: int, is_wide: bool) -> None:
    """Of rows one apart over 112 columns, two spread by 0.015, three by 0.025 of it."""
    usable = np.zeros((72, 112), bool)
    usable[30 : 30 + rows + 1] = True
    usable[30, ::2] = True
    if is_wide:
        assert fit_plane(rig, PLANE.depth_mm(rig), usable).plane.tilt_deg == pytest.approx(PLANE.tilt_deg)
    else:
        with pytest.raises(CalibrationError, match="form a line"):
            fit_plane(rig, PLANE.depth_mm(rig), usable)


def test_the_search_ends_when_the_same_pixels_are_on_the_plane(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = list[int]()

    def noted(values: np.ndarray) -> np.ndarray:
        asked.append(len(values))
        return np.asarray(robust_std(values))

    monkeypatch.setattr("dsl_core.calibration.common.plane.robust_std", noted)
    fit_plane(rig, seen(rig), np.ones((72, 112), bool))
    assert len(asked) == 1, "what is near the first plane stays"


def test_a_plane_is_chosen_by_the_median_of_its_judges(rig: Rig) -> None:
    """Nearly half of all stand elsewhere, all on one other plane, and the first pixel is one of them."""
    depth = PLANE.depth_mm(rig)
    depth[:34] *= 0.7
    near = _near_first_plane(pixel_rays(rig.camera), 1 / depth, np.ones((72, 112), bool))
    assert near[34:].all()
    assert not near[:34].any()


def test_three_pixels_on_a_line_choose_no_plane(rig: Rig) -> None:
    """Of two rows and a pixel most triples are on a line; none of these is taken."""
    on = np.zeros((72, 112), bool)
    on[30, 20:90] = on[31, 20:90] = True
    depth = PLANE.depth_mm(rig)
    near = _near_first_plane(pixel_rays(rig.camera), 1 / depth, on)
    assert near.all()


def test_the_rms_is_that_of_depths_in_millimetres(rig: Rig) -> None:
    sign = np.where(np.indices((72, 112)).sum(0) % 2, 1.0, -1.0)
    depth = PLANE.depth_mm(rig) / (1 + 2e-3 * sign)
    found = fit_plane(rig, depth, np.ones((72, 112), bool))
    assert found.rms_mm == pytest.approx(2e-3 * np.sqrt(np.mean(depth**2)), rel=1e-3)


@pytest.mark.parametrize("bulge", [-3.0, 0.0, 1.0, 5.0])
def test_a_bulge_towards_the_camera_is_measured_over_300_mm(rig: Rig, bulge: float) -> None:
    flat = PLANE.depth_mm(rig)
    points = pixel_rays(rig.camera) * flat
    across2 = ((points - points.mean((1, 2), keepdims=True)) ** 2).sum(0)
    # Along the axis a step is longer than towards the plane, whose normal is a little askew.
    towards = (bulge * (1 - across2 / 150.0**2)) * np.linalg.norm(PLANE.inverse) * 700.0
    depth = flat - towards + 0.5 * np.random.default_rng(1).standard_normal(flat.shape)
    found = bulge_mm(rig, depth, fit_plane(rig, depth, np.ones(flat.shape, bool)))
    assert found[0] == pytest.approx(bulge, abs=0.1)
    assert abs(found[0] - bulge) < 4 * found[1] + 0.02 * abs(bulge)
    assert found[1] < 0.05 + 0.05 * abs(bulge)


def test_a_bulge_is_refused_beyond_its_limit_and_its_deviations() -> None:
    assert bulge_figure("bulge", None, 1.0) == ()
    for value, std, passed in ((0.9, 0.01, True), (-1.1, 0.01, False), (1.1, 0.01, False), (1.1, 0.3, True)):
        (figure,) = bulge_figure("bulge", (value, std), 1.0)
        assert figure.passed is passed
