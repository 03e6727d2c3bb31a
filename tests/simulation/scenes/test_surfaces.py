"""Rays meet surfaces, and shadows fall, as closed forms say."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.scenes.catalogue import Scene, SceneTruth, make_scene
from dsl_core.simulation.scenes.surfaces import HeightField, Sphere

FULL = published_rig().camera
CAMERA = FULL.resized(223, 145)
CENTRE = published_rig().pose.projector_centre_mm


def see(scene: Scene, centre: NDArray[np.float64] = CENTRE) -> SceneTruth:
    return scene.render(CAMERA, centre)


def points(truth: SceneTruth) -> NDArray[np.float64]:
    """Points in camera coordinates, shape (3, h, w), mm."""
    return np.asarray(pixel_rays(CAMERA) * truth.depth_mm)


@pytest.mark.parametrize("name", ["relief", "face"])
def test_height_field_is_met_within_a_micrometre(name: str) -> None:
    scene = make_scene(name)
    field = scene.surfaces[0]
    assert isinstance(field, HeightField)
    rays = pixel_rays(CAMERA).reshape(3, -1)
    t = field.intersect(np.zeros(3), rays)
    p = rays * t
    gap = field.height(p[0], p[1]) - p[2]
    assert np.abs(gap).max() <= 1e-3
    # No earlier crossing: the height stays behind the ray all the way.
    for share in np.linspace(field.low_mm / t.max(), 1, 150, endpoint=False):
        q = rays * t * share
        assert (field.height(q[0], q[1]) > q[2]).all()


def test_no_shadow_is_seen_from_the_projector_itself() -> None:
    for name in ("relief", "sphere", "steps", "color-checker"):
        truth = see(make_scene(name), np.zeros(3))
        assert truth.lit.mean() > 0.999


def test_sphere_shadow_is_the_closed_form() -> None:
    scene = make_scene("sphere")
    ball = scene.surfaces[0]
    assert isinstance(ball, Sphere)
    truth = see(scene)
    beam = points(truth) - CENTRE[:, None, None]
    beam /= np.linalg.norm(beam, axis=0)
    to_ball = ball.centre_mm - CENTRE
    miss = np.linalg.norm(np.cross(beam, to_ball[:, None, None], axis=0), axis=0)
    wall = truth.material == 1
    np.testing.assert_array_equal(truth.lit[wall], miss[wall] > ball.radius_mm)
