"""Normals, shading and depth edges of surfaces whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.reconstruction.surface import (
    MIXED_REL_STD,
    Surface,
    _Best,
    _Fits,
    reconstruct_surface,
    windows_px,
)
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendering.shading import surface_shading
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.scenes.truth import SceneTruth

NOISE_MM = 0.15


def small_rig() -> Rig:
    rig = published_rig()
    return rig.model_copy(update={"camera": rig.camera.resized(120, 80)})


@pytest.mark.parametrize(
    ("scene", "options", "limit_deg"),
    [("plane", {"tilt_x_deg": 20.0, "tilt_y_deg": -15.0}, 0.02), ("sphere", {}, 3.5)],
)
def test_normals_of_known_surfaces(scene: str, options: dict[str, float], limit_deg: float) -> None:
    rig = small_rig()
    truth = make_scene(scene, **options).render(rig.camera, rig.pose.projector_centre_mm)
    surface = reconstruct_surface(rig, truth.depth_mm, np.full(truth.depth_mm.shape, 0.3), 5)
    length = np.linalg.norm(surface.normals, axis=0)
    cosine = (surface.normals * truth.normals).sum(0)
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    known = np.isfinite(angle) & ~surface.edge
    # Steep slopes at a sphere's rim are not planes within a window.
    known &= truth.normals[2] < -0.6
    assert known.sum() > 300
    assert length[known] == pytest.approx(1.0)
    assert np.percentile(angle[known], 75) < limit_deg


def test_shading_of_a_plane_is_cosine_over_squared_distance() -> None:
    rig = small_rig()
    truth = make_scene("plane", tilt_y_deg=25.0).render(rig.camera, rig.pose.projector_centre_mm)
    surface = reconstruct_surface(rig, truth.depth_mm, np.full(truth.depth_mm.shape, 0.3))
    points = pixel_rays(rig.camera) * truth.depth_mm
    to_light = rig.pose.projector_centre_mm[:, None, None] - points
    distance = np.linalg.norm(to_light, axis=0)
    expected = (truth.normals * to_light).sum(0) / distance * (700.0 / distance) ** 2
    assert surface.shading == pytest.approx(expected, rel=1e-3)
    assert not surface.edge.any()


def test_planes_beside_a_step_are_those_of_their_own_side() -> None:
    rig = small_rig()
    depth = np.full((80, 120), 700.0)
    depth[:, 60:] = 750.0
    surface = reconstruct_surface(rig, depth, np.full(depth.shape, 0.3), 5)
    inner = surface.normals[:, 4:-4, 4:-4]
    assert np.isfinite(inner).all()
    assert inner[2].max() < -0.999


def test_a_lonely_pixel_has_no_normal() -> None:
    rig = small_rig()
    depth = np.full((80, 120), np.nan)
    depth[10, 10], depth[40:60, 40:60] = 700.0, 700.0
    surface = reconstruct_surface(rig, depth, np.full(depth.shape, 0.3), 5)
    assert np.isnan(surface.normals[:, 10, 10]).all()
    assert np.isfinite(surface.normals[:, 50, 50]).all()


def seen(scene: str, size: tuple[int, int] = (222, 145)) -> tuple[Rig, SceneTruth, Surface]:
    """A scene's truth, and its surface from depth with noise."""
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(*size)})
    truth = make_scene(scene).render(rig.camera, rig.pose.projector_centre_mm)
    std = np.full(truth.depth_mm.shape, NOISE_MM)
    noise = NOISE_MM * np.random.default_rng(3).normal(size=std.shape)
    return rig, truth, reconstruct_surface(rig, np.where(truth.lit, truth.depth_mm, np.nan) + noise, std)


def shading_errors(rig: Rig, truth: SceneTruth, surface: Surface) -> tuple[NDArray[np.float64], ...]:
    """Relative errors of shading and their stated deviations, where nothing is flagged."""
    error = np.abs(surface.shading / surface_shading(rig, truth, True) - 1)
    counted = np.isfinite(error) & ~surface.edge
    return error[counted], surface.shading_rel_std[counted]


@pytest.mark.parametrize(("scene", "percentile_99"), [("sphere", 0.06), ("face", 0.07), ("steps", 0.02)])
def test_shading_of_bodies_is_as_sure_as_stated(scene: str, percentile_99: float) -> None:
    error, std = shading_errors(*seen(scene))
    assert np.percentile(error, 99) < percentile_99
    assert np.mean(error < 1.96 * std) > 0.94
    assert np.mean(error < 3 * std) > 0.99


def beside_steps(depth_mm: NDArray[np.float64], step_mm: float) -> NDArray[np.bool_]:
    """Pixels with a neighbour above, below or at a side whose depth differs by more."""
    found = np.zeros(depth_mm.shape, bool)
    for axis in (0, 1):
        far = np.abs(np.diff(depth_mm, axis=axis)) > step_mm
        for side in (0, 1):
            found |= np.pad(far, [(side, 1 - side) if i == axis else (0, 0) for i in (0, 1)])
    return found


def test_pixels_beside_a_jump_are_flagged_and_unsure_and_no_others() -> None:
    _, truth, surface = seen("steps")
    z = np.where(truth.lit, truth.depth_mm, np.nan)
    jump = beside_steps(z, 20.0)
    assert jump.sum() > 300
    assert np.mean(surface.edge[jump]) > 0.99
    assert np.nanmin(surface.shading_rel_std[jump & surface.edge]) >= MIXED_REL_STD
    away = np.isfinite(z) & ~np.asarray(binary_dilation(beside_steps(z, 5.0), iterations=2))
    assert away.sum() > 10000
    assert np.mean(surface.edge[away]) < 0.01


def test_a_steep_plane_has_no_edges() -> None:
    rig = small_rig()
    truth = make_scene("plane", tilt_y_deg=60.0).render(rig.camera, rig.pose.projector_centre_mm)
    std = np.full(truth.depth_mm.shape, NOISE_MM)
    noise = NOISE_MM * np.random.default_rng(3).normal(size=std.shape)
    assert not reconstruct_surface(rig, truth.depth_mm + noise, std).edge.any()


def test_a_plane_takes_the_largest_windows_for_the_least_noise() -> None:
    rig = small_rig()
    depth = 700 + NOISE_MM * np.random.default_rng(3).normal(size=(80, 120))
    fine, coarse = (reconstruct_surface(rig, depth, np.full(depth.shape, NOISE_MM), w) for w in (5, 15))
    off = [np.hypot(*surface.normals[:2, 10:-10, 10:-10]) for surface in (fine, coarse)]
    # The noise of a slope falls as the square of the window's size.
    assert np.sqrt(np.mean(off[1] ** 2)) < 1.5 / 9 * np.sqrt(np.mean(off[0] ** 2))


def test_windows_shrink_to_three_pixels() -> None:
    assert windows_px(19) == [19, 11, 7, 5, 3]
    assert windows_px(3) == [3]


def test_a_narrow_piece_beside_a_step_has_the_plane_of_its_own_side() -> None:
    depth = np.full((80, 120), 700.0)
    depth[20:60, 40:60] = np.nan
    depth[20:60, 46:50], depth[20:60, 50:54] = 700.0, 750.0
    surface = reconstruct_surface(small_rig(), depth, np.full(depth.shape, 0.3), 5)
    piece = surface.normals[:, 24:56, 46:54]
    assert np.isfinite(piece).all()
    assert piece[2].max() < -0.999


@pytest.mark.parametrize(("down", "right"), [(d, r) for d in (-1, 0, 1) for r in (-1, 0, 1)])
@pytest.mark.parametrize(("count", "offered"), [(13.0, True), (12.0, False)])
def test_a_pixel_takes_the_plane_of_the_window_on_any_side_of_it(
    down: int, right: int, count: float, offered: bool
) -> None:
    """Windows of five pixels: of those beside a pixel, two away, more than half have to be known."""
    shape = (11, 12)
    fit, inverse = np.zeros((3, *shape)), np.full(shape, 0.002)
    variance, zero = np.full(shape, np.inf), np.zeros(shape)
    source = 5 + 2 * down, 6 + 2 * right
    variance[source], fit[(slice(None), *source)] = 1e-12, (0.0, 0.0, 0.002)
    best = _Best(np.ones((3, *shape)), inverse, np.full(shape, 1e-6))
    # The window around the pixel itself does not fit.
    misfit = zero.copy()
    if (down, right) != (0, 0):
        variance[5, 6], misfit[5, 6] = 0.1, 10.0
    best.variance[5, 6] = 10.0
    best.offer(_Fits(fit, variance, misfit, zero, np.full(shape, count)), 5)
    here = down == right == 0
    assert (best.variance[5, 6] == 1e-12) == (offered or here)
    assert (best.fit[2, 5, 6] == 0.002) == (offered or here)


def test_a_plane_is_taken_where_it_is_clearly_better_and_holds_the_pixel() -> None:
    shape = (1, 3)
    rays, inverse = np.zeros((3, *shape)), np.full(shape, 0.002)
    rays[2] = 1.0
    fit = np.zeros((3, *shape))
    # On the plane within three deviations, and ten deviations off.
    fit[2, 0] = [0.002, 0.002 + 2.9e-6, 0.002 + 10e-6]
    best = _Best(rays, inverse, np.full(shape, 1e-6))
    best.variance[:] = 1.0
    one = np.ones(shape)
    best.offer(_Fits(fit, np.full(shape, 0.69), 0 * one, 1e10 * one, 25 * one), 3)
    assert best.variance[0] == pytest.approx([0.69, 0.69, 1.0])
    best.variance[:] = 1.0
    best.offer(_Fits(fit, np.full(shape, 0.71), 0 * one, 1e10 * one, 25 * one), 3)
    assert best.variance[0].tolist() == [1.0, 1.0, 1.0]


def test_blocks_of_a_large_picture_make_the_surface_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    rig, rng = small_rig(), np.random.default_rng(4)
    rows, columns = np.indices((80, 120))
    depth = 700 + 20 * np.sin(columns / 15) * np.cos(rows / 12) + rng.normal(size=rows.shape) * NOISE_MM
    depth[30:50, 50:80] -= 60
    depth[rng.random(depth.shape) < 0.02] = np.nan
    std = np.where(np.isfinite(depth), NOISE_MM, np.nan)
    whole = reconstruct_surface(rig, depth, std, 7)
    monkeypatch.setattr("dsl_core.reconstruction.surface.BLOCK_PX", 4000)
    blocks = reconstruct_surface(rig, depth, std, 7)
    np.testing.assert_array_equal(blocks.edge, whole.edge)
    for name in ("normals", "shading", "shading_rel_std"):
        np.testing.assert_allclose(getattr(blocks, name), getattr(whole, name), rtol=1e-6, atol=1e-7)
