"""Scenes against closed forms: depth, normals, occlusion, shadow and options."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.scenes.catalogue import Scene, SceneTruth, make_scene, scene_catalogue
from dsl_core.simulation.scenes.surfaces import HeightField, Sphere

FULL = published_rig().camera
CAMERA = FULL.resized(223, 145)
CENTRE = published_rig().pose.projector_centre_mm
NAMES = [entry.name for entry in scene_catalogue()]


def see(scene: Scene, centre: NDArray[np.float64] = CENTRE) -> SceneTruth:
    return scene.render(CAMERA, centre)


def points(truth: SceneTruth) -> NDArray[np.float64]:
    """Points in camera coordinates, shape (3, h, w), mm."""
    return np.asarray(pixel_rays(CAMERA) * truth.depth_mm)


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


@pytest.mark.parametrize("name", NAMES)
def test_rendering_twice_gives_the_same(name: str) -> None:
    first, second = see(make_scene(name)), see(make_scene(name))
    np.testing.assert_array_equal(first.depth_mm, second.depth_mm)
    np.testing.assert_array_equal(first.lit, second.lit)
    np.testing.assert_array_equal(first.material, second.material)


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


def test_reflectance_cube_picks_the_material() -> None:
    truth = see(make_scene("filters"))
    cube = truth.reflectance(np.array([450.0, 550.0, 650.0]))
    assert cube.shape == (3, 145, 223)
    np.testing.assert_allclose(cube[:, truth.material == 4].mean(axis=1), [0, 0.8, 0], atol=1e-3)


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
