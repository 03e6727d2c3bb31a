"""Scenes against closed forms: depth, normals, occlusion, shadow and options."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.scenes.catalogue import Scene, SceneTruth, make_scene, scene_catalogue

FULL = published_rig().camera
CAMERA = FULL.resized(223, 145)
CENTRE = published_rig().pose.projector_centre_mm
NAMES = [entry.name for entry in scene_catalogue()]


def see(scene: Scene, centre: NDArray[np.float64] = CENTRE) -> SceneTruth:
    return scene.render(CAMERA, centre)


def test_every_scene_is_on_offer() -> None:
    expected = "plane bowed stage steps sphere box wax color-checker board filters leaves relief face"
    assert set(NAMES) == set(expected.split())
    assert all(entry.description for entry in scene_catalogue())


@pytest.mark.parametrize("name", NAMES)
def test_truth_is_complete_and_consistent(name: str) -> None:
    scene = make_scene(name)
    truth = see(scene)
    solid = np.isfinite(truth.depth_mm)
    assert solid.mean() > 0.99
    assert truth.depth_mm.shape == (145, 223)
    assert truth.material.dtype == np.int32
    np.testing.assert_array_equal(truth.material >= 0, solid)
    assert truth.material.max() < len(truth.materials.names)
    assert set(np.unique(truth.material)) == set(range(len(truth.materials.names)))
    np.testing.assert_allclose(np.linalg.norm(truth.normals, axis=0)[solid], 1.0, atol=1e-9)
    assert (np.einsum("ihw,ihw->hw", truth.normals, pixel_rays(CAMERA))[solid] <= 1e-12).all()
    assert np.nanmin(truth.depth_mm) > 500
    assert np.nanmax(truth.depth_mm) < 1000
    assert truth.lit.mean() > 0.9
    spectra = truth.materials.reflectance
    assert spectra.shape == (len(truth.materials.names), truth.materials.wavelengths_nm.size)
    assert spectra.min() >= 0
    assert spectra.max() <= 1


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_rendering_twice_gives_the_same(name: str) -> None:
    first, second = see(make_scene(name)), see(make_scene(name))
    np.testing.assert_array_equal(first.depth_mm, second.depth_mm)
    np.testing.assert_array_equal(first.lit, second.lit)
    np.testing.assert_array_equal(first.material, second.material)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_normals_agree_with_differences_of_depth(name: str) -> None:
    lens = FULL.resized(445, 290)
    truth = make_scene(name).render(lens, CENTRE)
    p = pixel_rays(lens) * truth.depth_mm
    across, down = p[:, 1:-1, 2:] - p[:, 1:-1, :-2], p[:, 2:, 1:-1] - p[:, :-2, 1:-1]
    numeric = np.cross(down, across, axis=0)
    numeric /= np.linalg.norm(numeric, axis=0)
    cosine = np.abs((numeric * truth.normals[:, 1:-1, 1:-1]).sum(axis=0))
    # Edges and depth jumps are where differences of depth mean nothing.
    assert (cosine > np.cos(np.radians(3.0))).mean() > 0.93


def test_unknown_scene_and_option_name_the_known_ones() -> None:
    with pytest.raises(PlanError, match="color-checker"):
        make_scene("moon")
    with pytest.raises(PlanError, match="tilt_x_deg"):
        make_scene("plane", depht_mm=3)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("plane", {"depth_mm": "far"}),
        ("plane", {"depth_mm": "-3"}),
        ("plane", {"depth_mm": "nan"}),
        ("stage", {"index": 15}),
        ("stage", {"index": "1.5"}),
        ("steps", {"count": 0}),
    ],
)
def test_bad_values_are_refused(name: str, options: dict[str, str | int]) -> None:
    with pytest.raises(PlanError, match=next(iter(options))):
        make_scene(name, **options)
