"""Flat targets are where they are asked for."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.scenes.catalogue import Scene, SceneTruth, make_scene

FULL = published_rig().camera
CAMERA = FULL.resized(223, 145)
CENTRE = published_rig().pose.projector_centre_mm


def see(scene: Scene, centre: NDArray[np.float64] = CENTRE) -> SceneTruth:
    return scene.render(CAMERA, centre)


@pytest.mark.parametrize(("tilt_x", "tilt_y"), [(0.0, 0.0), (20.0, 0.0), (0.0, -30.0), (12.0, 25.0)])
def test_plane_depth_is_the_closed_form(tilt_x: float, tilt_y: float) -> None:
    truth = see(make_scene("plane", depth_mm=700, tilt_x_deg=tilt_x, tilt_y_deg=tilt_y))
    normal = truth.normals[:, 70, 100]
    expected = 700.0 * normal[2] / np.einsum("i,ihw->hw", normal, pixel_rays(CAMERA))
    np.testing.assert_allclose(truth.depth_mm, expected, rtol=1e-12)
    a, b = np.radians([tilt_x, tilt_y])
    np.testing.assert_allclose(normal[2], -np.cos(a) * np.cos(b), atol=1e-12)
    assert truth.lit.all()


def test_positive_tilts_move_the_lower_and_the_right_edge_away() -> None:
    lower = see(make_scene("plane", tilt_x_deg=10)).depth_mm
    right = see(make_scene("plane", tilt_y_deg=10)).depth_mm
    assert lower[-1, 100] > 700 > lower[0, 100]
    assert right[70, -1] > 700 > right[70, 0]


@pytest.mark.parametrize(("index", "depth"), [(0, 600.0), (7, 750.0), (14, 900.0)])
def test_stage_positions(index: int, depth: float) -> None:
    np.testing.assert_allclose(see(make_scene("stage", index=index)).depth_mm, depth)


def test_stage_anywhere() -> None:
    np.testing.assert_allclose(see(make_scene("stage", position_mm=695.2)).depth_mm, 695.2)


def test_chart_patches_are_in_reading_order_and_large() -> None:
    truth = make_scene("color-checker").render(FULL, CENTRE)
    rows, columns = np.mgrid[:580, :890]
    middles = []
    for patch in range(24):
        where = truth.material == patch
        assert np.ptp(columns[where]) >= 100
        assert np.ptp(rows[where]) >= 100
        assert truth.lit[where].all()
        middles.append((rows[where].mean(), columns[where].mean()))
    grid = np.array(middles).reshape(4, 6, 2)
    assert (np.diff(grid[..., 0], axis=0) > 100).all()
    assert (np.diff(grid[..., 1], axis=1) > 100).all()
    assert truth.materials.names[0] == "dark skin"
    assert truth.materials.names[18].startswith("white")
