"""Targets with relief have the shape they are named for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.scenes.catalogue import Scene, SceneTruth, make_scene
from dsl_core.simulation.scenes.surfaces import Sphere

FULL = published_rig().camera
CAMERA = FULL.resized(223, 145)
CENTRE = published_rig().pose.projector_centre_mm


def see(scene: Scene, centre: NDArray[np.float64] = CENTRE) -> SceneTruth:
    return scene.render(CAMERA, centre)


def points(truth: SceneTruth) -> NDArray[np.float64]:
    """Points in camera coordinates, shape (3, h, w), mm."""
    return np.asarray(pixel_rays(CAMERA) * truth.depth_mm)


def test_sphere_has_its_radius_and_radial_normals() -> None:
    scene = make_scene("sphere", radius_mm=50)
    ball = scene.surfaces[0]
    assert isinstance(ball, Sphere)
    truth = see(scene)
    on_ball = truth.material == 0
    offset = (points(truth) - ball.centre_mm[:, None, None])[:, on_ball]
    np.testing.assert_allclose(np.linalg.norm(offset, axis=0), 50.0, atol=1e-9)
    np.testing.assert_allclose(truth.normals[:, on_ball], offset / 50.0, atol=1e-9)


def test_steps_have_their_depths() -> None:
    truth = see(make_scene("steps", depth_mm=650, step_mm=20, count=4))
    fronts = truth.depth_mm[(truth.material == 0) & (truth.normals[2] < -0.5)]
    np.testing.assert_allclose(np.unique(fronts.round(6)), [650, 670, 690, 710])


def test_box_is_concave() -> None:
    truth = see(make_scene("box", depth_mm=760, deep_mm=110))
    red, green = truth.material == 1, truth.material == 2
    assert truth.normals[0, red].min() > 0.99
    assert truth.normals[0, green].max() < -0.99
    assert 650 <= truth.depth_mm[red].min() < truth.depth_mm[red].max() <= 760


def test_relief_occludes_and_shadows() -> None:
    truth = see(make_scene("relief"))
    jumps = np.abs(np.diff(truth.depth_mm, axis=1)) > 20
    assert jumps.sum() > 100
    bar, plaster = truth.material == 3, truth.material == 0
    shadow = ~truth.lit & plaster & (np.arange(145)[:, None] < 60)
    # The projector stands to the right of the camera, so that shadows fall to the left.
    left = np.flatnonzero(shadow[20, :130])
    assert left.size > 3
    assert left.max() < np.flatnonzero(bar[20]).min() + 1
