"""What is known of a scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.scenes.catalogue import Scene, SceneTruth, make_scene

FULL = published_rig().camera
CAMERA = FULL.resized(223, 145)
CENTRE = published_rig().pose.projector_centre_mm


def see(scene: Scene, centre: NDArray[np.float64] = CENTRE) -> SceneTruth:
    return scene.render(CAMERA, centre)


def test_reflectance_cube_picks_the_material() -> None:
    truth = see(make_scene("filters"))
    cube = truth.reflectance(np.array([450.0, 550.0, 650.0]))
    assert cube.shape == (3, 145, 223)
    np.testing.assert_allclose(cube[:, truth.material == 4].mean(axis=1), [0, 0.8, 0], atol=1e-3)
