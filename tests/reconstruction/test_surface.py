"""Normals, shading and depth edges of surfaces whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from dsl_core.model.result import REASONS, Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays, rays_in
from dsl_core.optics.sensor import relative_gain
from dsl_core.reconstruction import surface as surface_module
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
    assert np.isnan(surface.shading[10, 10]), "and so it has no spectrum"
    assert surface.edge[10, 10]
    assert "neither is the spectrum" in REASONS[Flag.DEPTH_EDGE]
    assert np.isfinite(surface.normals[:, 50, 50]).all()


def seen(
    scene: str, size: tuple[int, int] = (222, 145), share: float = 1.0
) -> tuple[Rig, SceneTruth, Surface]:
    """A scene's truth, and its surface from depth with noise, which is a share of the stated deviation."""
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(*size)})
    truth = make_scene(scene).render(rig.camera, rig.pose.projector_centre_mm)
    std = np.full(truth.depth_mm.shape, NOISE_MM / share)
    noise = NOISE_MM * np.random.default_rng(3).normal(size=std.shape)
    depth = np.where(truth.lit, truth.depth_mm, np.nan) + noise
    return rig, truth, reconstruct_surface(rig, depth, std)


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


@pytest.mark.parametrize("scene", ["sphere", "face"])
def test_what_deviations_have_in_common_hides_no_curvature(scene: str) -> None:
    # Windows as large as for noise of all of it would be off by a fifth, and not say so.
    error, std = shading_errors(*seen(scene, share=1 / 3))
    assert np.percentile(error, 99) < 0.06
    assert np.mean(error < 3 * std) > 0.99


@pytest.mark.parametrize(("share", "found"), [(0.3, 0.3), (0.95, 1.0), (1.5, 1.0)])
def test_the_share_of_the_variance_that_scatters_is_measured_unless_as_stated(
    share: float, found: float
) -> None:
    rig = small_rig()
    noise = NOISE_MM * np.random.default_rng(6).normal(size=(80, 120))
    std = np.full(noise.shape, NOISE_MM / share**0.5)
    measured = surface_module._scatter_share(rig, 700.0 + noise, std, 9)
    assert measured == pytest.approx(found, rel=0.1)
    nothing = np.full(noise.shape, np.nan)
    assert surface_module._scatter_share(rig, nothing, nothing, 9) == 1.0


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
    best.offer(_Fits(fit, variance, misfit, zero, np.full(shape, count), zero), 5)
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
    best.offer(_Fits(fit, np.full(shape, 0.69), 0 * one, 1e10 * one, 25 * one, one), 3)
    assert best.variance[0] == pytest.approx([0.69, 0.69, 1.0])
    best.variance[:] = 1.0
    best.offer(_Fits(fit, np.full(shape, 0.71), 0 * one, 1e10 * one, 25 * one, one), 3)
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


@pytest.mark.parametrize("side", [np.s_[:1, :], np.s_[-1:, :], np.s_[:, :1], np.s_[:, -1:], np.s_[40:41, :]])
def test_a_single_row_of_another_surface_has_no_sure_slope_from_its_neighbours(
    side: tuple[slice, slice],
) -> None:
    """A plane through it and the row beside it leaves nothing, and is on neither of both surfaces."""
    rig = small_rig()
    depth = np.full((80, 120), 700.0)
    depth[side] = 780.0
    noisy = depth + np.random.default_rng(0).normal(0, 0.05, depth.shape)
    found = reconstruct_surface(rig, noisy, np.full(depth.shape, 0.05), 5)
    to_light = rig.pose.projector_centre_mm[:, None, None] - pixel_rays(rig.camera) * depth
    distance = np.linalg.norm(to_light, axis=0)
    facing = -to_light[2] / distance * (rig.reference_distance_mm / distance) ** 2
    off = np.abs(found.shading / (facing * relative_gain(rig)) - 1) / found.shading_rel_std
    assert (off[side] < 3).all()
    assert np.median(found.shading_rel_std) < 0.01


def test_planes_are_weighted_least_squares_in_every_window() -> None:
    rng = np.random.default_rng(5)
    shape, window = (9, 11), 5
    rays = np.stack([*np.meshgrid(np.linspace(-0.2, 0.2, 11), np.linspace(-0.1, 0.15, 9)), np.ones(shape)])
    inverse = 0.002 + 1e-4 * rng.normal(size=shape)
    std = rng.uniform(0.5e-6, 2e-6, shape)
    valid = rng.random(shape) < 0.9
    found = surface_module._plane_fits(rays, np.where(valid, inverse, 0.0), std, valid, window)
    for y, x in ((4, 5), (4, 2), (2, 8), (0, 0), (8, 5)):
        near = np.zeros(shape, bool)
        near[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3] = True
        near &= valid
        count = near.sum()
        design, weight = rays[:, near].T, 1 / std[near] ** 2
        normal = design.T @ (design * weight[:, None])
        plane = np.linalg.solve(normal, design.T @ (weight * inverse[near]))
        assert found.fit[:, y, x] == pytest.approx(plane, rel=1e-5)
        assert found.count[y, x] == pytest.approx(count)
        share = weight / weight.sum()
        centred = design[:, :2] - share @ design[:, :2]
        moments = centred.T @ (centred * share[:, None])
        unit = np.diag(moments).max() / np.linalg.det(moments) / count
        assert found.unit[y, x] == pytest.approx(unit, rel=1e-5)
        assert found.variance[y, x] == pytest.approx(unit * (share @ std[near] ** 2), rel=1e-5)
    # Six pixels, or fifteen in a hundred of a large window, make a plane.
    few = np.zeros(shape, bool)
    few[3:5, 4:7] = True
    assert surface_module._plane_fits(rays, inverse, std, few, window).count[4, 5] == pytest.approx(6)
    few[3, 4] = False
    assert not surface_module._plane_fits(rays, inverse, std, few, window).count.any()
    few[2:5, 3:7] = True
    assert surface_module._plane_fits(rays, inverse, std, few, 9).count[4, 5] == 0.0
    few[2, 7] = True
    assert surface_module._plane_fits(rays, inverse, std, few, 9).count[4, 5] == pytest.approx(13)


def test_misfit_is_what_planes_leave_beyond_noise_here_or_all_around() -> None:
    shape = (40, 40)
    count, noise = np.full(shape, 9.0), np.full(shape, 2.0)
    # Three parameters take a third of nine squares: 2 of noise and 3 of misfit leave 10 / 3.
    residual = np.full(shape, 5.0 * 6 / 9)
    assert surface_module._beyond_noise(residual, noise, count, 3)[20, 20] == pytest.approx(3.0)
    # Ten deviations of the noise are clear by themselves; a little less is averaged over seven pixels.
    limit = 10 * 2.0 * np.sqrt(2 / 9)
    for excess, here, beside in (
        (1.01 * limit, 1.01 * limit, 0.0),
        (0.99 * limit, 0.99 * limit / 49, 0.99 * limit / 49),
    ):
        residual = np.full(shape, 2.0 * 6 / 9)
        residual[20, 20] += excess * 6 / 9
        found = surface_module._beyond_noise(residual, noise, count, 3)
        assert found[20, 20] == pytest.approx(here)
        assert found[20, 23] == pytest.approx(beside, abs=1e-9)
        assert found[20, 24] == pytest.approx(0.0, abs=1e-9)
    # Windows without a plane do not count, nor is less than nothing left.
    count[:, :20] = 0.0
    residual = np.where(count > 0, 3.0 * 6 / 9, 99.0)
    assert surface_module._beyond_noise(residual, noise, count, 3)[20, 22] == pytest.approx(1.0)
    assert not surface_module._beyond_noise(0 * residual, noise, count, 3)[:, 23:].any()


@pytest.mark.parametrize(("down", "right"), [(d, r) for d in (-1, 0, 1) for r in (-1, 0, 1) if d or r])
def test_a_jump_is_five_deviations_and_four_thousandths_off_a_plane(down: int, right: int) -> None:
    shape = (7, 8)
    y, x = np.indices(shape) * 0.01
    rays, plane = np.stack([x, y, np.ones(shape)]), 0.002 + 0.001 * x - 0.0005 * y
    slope = np.stack([np.full(shape, 0.001), np.full(shape, -0.0005)])
    std, valid = np.full(shape, 3e-6), np.ones(shape, bool)
    std[3 + down, 4 + right] = 4e-6
    limit = 5 * 5e-6 + 0.004 * plane[3, 4]
    for sign in (1, -1):
        for share, found in ((1.01, True), (0.97, False)):
            inverse = plane.copy()
            inverse[3 + down, 4 + right] += sign * share * limit
            edge = surface_module._beside_jump(rays, inverse, slope, std, valid)
            assert edge[3, 4] == found
            assert not edge[0, 0]
    gone = valid.copy()
    gone[3 + down, 4 + right] = False
    assert not surface_module._beside_jump(rays, inverse * 2, slope, std, gone)[3 + down, 4 + right]


def test_shading_is_the_cosine_over_the_squared_distance_and_bounded() -> None:
    rig = small_rig()
    light = rig.pose.projector_centre_mm
    angles = np.radians([0.0, 30.0, 86.0, 88.0])
    points = np.stack([light + np.array([0, 0, 500.0])] * 4, 1)[:, None]
    normals = -np.stack([np.sin(angles), 0 * angles, np.cos(angles)])[:, None]
    gain = np.full((1, 4), 1.5)
    shading, tangent = surface_module._shading(rig, points, normals, gain)
    cosine = np.maximum(np.cos(angles), 0.05)
    assert shading[0] == pytest.approx(1.5 * cosine * (rig.reference_distance_mm / 500) ** 2)
    assert tangent[0] == pytest.approx(np.sqrt(1 - cosine**2) / cosine, abs=1e-7)


def test_the_largest_window_is_a_forty_fifth_of_the_width_and_odd() -> None:
    rig = published_rig()
    widths = {890: 19, 900: 21, 945: 21, 990: 23, 100: 5, 222: 5}
    for width, window in widths.items():
        sized = rig.model_copy(update={"camera": rig.camera.model_copy(update={"width_px": width})})
        assert surface_module.default_window_px(sized) == window


def test_deviations_hold_noise_tilt_and_mixed_pixels() -> None:
    rig = small_rig()
    depth = np.full((80, 120), 700.0)
    depth[:, 60:] = 760.0
    surface = reconstruct_surface(rig, depth, np.full(depth.shape, 0.7), 5)
    rays, std = rays_in(rig.camera, slice(0, 80), slice(0, 120)), 0.7 / depth**2
    fits = surface_module._plane_fits(rays, 1 / depth, std, depth > 0, 5)
    spread = np.sqrt(fits.variance[40, 20]) / np.linalg.norm(fits.fit[:, 40, 20])
    point = rays_in(rig.camera, slice(0, 80), slice(0, 120))[:, 40, 20] * 700
    to_light = rig.pose.projector_centre_mm - point
    cosine = -surface.normals[:, 40, 20] @ to_light / np.linalg.norm(to_light) * -1
    tangent = np.sqrt(1 - cosine**2) / cosine
    assert not surface.edge[40, 20]
    assert surface.shading_rel_std[40, 20] == pytest.approx(
        np.hypot(tangent * spread, 2 * 0.7 / 700), rel=1e-3
    )
    beside = surface.edge & (np.abs(np.arange(120) - 59.5) < 1)
    assert beside[40].sum() == 2
    assert (surface.shading_rel_std[beside] > MIXED_REL_STD).all()
    assert pytest.approx(np.var(np.linspace(0.5, 1, 100_001)) * 2, rel=1e-3) == MIXED_REL_STD**2


def test_beside_what_is_out_of_the_calibrated_depths_is_an_edge() -> None:
    rig = small_rig()
    depth = np.full((rig.camera.height_px, rig.camera.width_px), 700.0)
    beyond = np.zeros(depth.shape, bool)
    beyond[:, 20:] = True
    seen = np.where(beyond, np.nan, depth)
    std = np.full(depth.shape, 0.3)
    edge = reconstruct_surface(rig, seen, std, 5, beyond).edge
    assert edge[:, 19].all()
    assert not edge[:, :19].any()
    assert not reconstruct_surface(rig, seen, std, 5).edge.any(), "a shadow is none"
    # A surface that leaves the range goes on beyond it.
    far = seen + rig.depth_range_mm[1] - 705.0
    assert not reconstruct_surface(rig, far, std, 5, beyond).edge.any()
