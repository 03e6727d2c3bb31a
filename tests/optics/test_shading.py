"""Light that a point receives, and planes in front of a camera."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.geometry import Lens
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.shading import Plane, plane_shading, shading
from dsl_core.simulation.published_rig import published_rig

CAMERA = Lens(width_px=8, height_px=6, fx_px=10.0, fy_px=10.0, cx_px=3.5, cy_px=2.5)
RIG = published_rig().model_copy(update={"camera": CAMERA})
#: Through (0, 0, 500), its normal 30 degrees off the axis, towards +x.
NORMAL = np.array([np.sin(np.pi / 6), 0.0, -np.cos(np.pi / 6)])
TILTED = Plane(-NORMAL / (500 * np.cos(np.pi / 6)))


def test_a_plane_knows_its_distance_normal_and_tilt() -> None:
    assert TILTED.distance_mm == pytest.approx(500.0)
    assert TILTED.normal == pytest.approx(NORMAL)
    assert TILTED.tilt_deg == pytest.approx(30.0)
    upright = Plane(np.array([0.0, 0.0, 1 / 700]))
    assert upright.distance_mm == pytest.approx(700.0)
    assert upright.tilt_deg == 0.0


def test_depth_of_a_plane_is_where_rays_meet_it_in_front_of_the_camera() -> None:
    depth = TILTED.depth_mm(RIG)
    points = pixel_rays(CAMERA) * depth
    there = np.isfinite(depth)
    assert there.all()
    assert np.tensordot(NORMAL, points, 1) == pytest.approx(float(NORMAL @ [0, 0, 500.0]))
    assert np.isnan(Plane(np.array([0.0, 0.0, -1 / 500])).depth_mm(RIG)).all()
    # So steep that rays to one side never meet it.
    steep = Plane(np.array([-1 / 100, 0.0, 1 / 500])).depth_mm(RIG)
    assert (np.isnan(steep) == (pixel_rays(CAMERA)[0] >= 0.2)).all()


def test_shading_is_the_cosine_of_incidence_over_the_squared_distance() -> None:
    centre = RIG.pose.projector_centre_mm
    down = np.array([[0.0, 0.6, 0.0], [0.0, 0.0, 0.0], [-1.0, -0.8, 1.0]])
    points = centre[:, None] + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [400.0, 400.0, 400.0]])
    found = shading(RIG, points, down)
    fall = (RIG.reference_distance_mm / 400) ** 2
    assert found == pytest.approx([fall, 0.8 * fall, 0.0])


def test_shading_of_a_plane_is_that_of_its_points() -> None:
    found = plane_shading(RIG, TILTED)
    row, column = 4, 6
    point = pixel_rays(CAMERA)[:, row, column] * TILTED.depth_mm(RIG)[row, column]
    to_light = RIG.pose.projector_centre_mm - point
    distance = np.linalg.norm(to_light)
    wanted = NORMAL @ to_light / distance * (RIG.reference_distance_mm / distance) ** 2
    assert found.shape == (6, 8)
    assert found[row, column] == pytest.approx(wanted)
