"""The plane of a target is found through rounded columns and in spite of what stands before it."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.common.plane import fit_plane
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Rig
from dsl_core.optics.shading import Plane
from dsl_core.simulation.published_rig import published_rig

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
