"""A highlight is found by its white light and its place; matt, coloured and shaded surfaces have none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, gaussian_filter

from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.sensor import bayer_channels, relative_gain
from dsl_core.optics.spectra import chain_response
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.reconstruction.scan_result import with_highlight
from dsl_core.reconstruction.spectral import highlights
from dsl_core.reconstruction.spectral.highlights import (
    Highlight,
    fit_highlights,
    follow_highlights,
    surfaces_between_edges,
    towards_mirror,
)
from dsl_core.reconstruction.surface import Surface
from dsl_core.simulation.effects.specular import highlight
from dsl_core.simulation.scenes.truth import Finish
from dsl_core.simulation.sim_devices import open_twin

YELLOW = np.array([0.7, 0.5, 0.06])


@pytest.fixture(scope="module")
def ball() -> tuple[Rig, Geometry]:
    """A ball as it is, before anything is known of its light."""
    world = open_twin({"scene": "sphere", "size": "112x72"}).camera.world  # type: ignore[attr-defined]
    truth, shape = world.truth, (72, 112)
    on_ball = truth.material == truth.materials.names.index("yellow")
    edge = ~on_ball
    surface = Surface(
        truth.normals.astype(np.float32), np.full(shape, 0.8, np.float32), np.zeros(shape, np.float32), edge
    )
    none, one = np.zeros(shape, np.float32), np.ones(shape, np.float32)
    flags = np.where(edge, int(Flag.DEPTH_EDGE), 0).astype(np.uint16)
    depth = np.asarray(truth.depth_mm, np.float64)
    return world.rig, Geometry(one, one, depth, np.ones(shape), none, none, none, none, flags, surface)


def lit(rig: Rig, geometry: Geometry, reflectance: np.ndarray) -> Geometry:
    """The ball with a reflectance (3, rows, columns) in each colour, and noise of 0.5 % of white."""
    channel = bayer_channels(rig.sensor.bayer, *geometry.flags.shape)
    white = chain_response(rig, 0, np.arange(400.0, 701.0)).sum((1, 2))[channel] * relative_gain(rig)
    own = np.take_along_axis(reflectance, channel[None], 0)[0]
    noise = 0.005 * np.random.default_rng(0).standard_normal(own.shape)
    light = (0.8 * white * (own + noise)).astype(np.float32)
    return replace(geometry, amplitude=light, amplitude_std=(0.004 * white).astype(np.float32))


def find_highlight(rig: Rig, geometry: Geometry, towards: np.ndarray) -> Highlight | None:
    """That which is sure of the ball, the only surface."""
    found = fit_highlights(rig, geometry, towards, surfaces_between_edges(geometry, towards)).get(1)
    return found if found is not None and found.is_sure else None


def coloured(
    rig: Rig, geometry: Geometry, gloss: float, share: tuple[float, float, float] = (1, 1, 1)
) -> np.ndarray:
    """Yellow with the twin's highlight, of which each colour shows a share."""
    points = (pixel_rays(rig.camera) * geometry.depth_mm).reshape(3, -1)
    normals = geometry.surface.normals.reshape(3, -1)
    shine = highlight(Finish(gloss=gloss, roughness=0.4), points, normals, rig.pose.projector_centre_mm)
    lobe = np.nan_to_num(shine.reshape(geometry.flags.shape))
    return np.asarray(YELLOW[:, None, None] + np.array(share)[:, None, None] * lobe)


def test_a_highlight_is_found_with_its_width_and_height(ball: tuple[Rig, Geometry]) -> None:
    rig, geometry = ball
    towards = towards_mirror(rig, geometry)
    reflectance = coloured(rig, geometry, 0.02)
    found = find_highlight(rig, lit(rig, geometry, reflectance), towards)
    assert found is not None
    assert found.roughness == 0.4
    added = reflectance[0] - YELLOW[0]
    assert np.nanmax(added) > 0.15
    on_ball = geometry.flags == 0
    assert np.abs(found.at(towards) - added)[on_ball].max() < 0.15 * np.nanmax(added)
    assert found.colours == pytest.approx((found.peak,) * 3, rel=0.2)


@pytest.mark.parametrize(
    ("gloss", "share"), [(0.0, (1, 1, 1)), (0.0009, (1, 1, 1)), (0.02, (1, 0, 0)), (0.02, (1, 0.7, 0.08))]
)
def test_what_is_faint_or_not_white_is_none(
    ball: tuple[Rig, Geometry], gloss: float, share: tuple[float, float, float]
) -> None:
    rig, geometry = ball
    towards = towards_mirror(rig, geometry)
    seen = lit(rig, geometry, coloured(rig, geometry, gloss, share))
    assert find_highlight(rig, seen, towards) is None
    same, told = follow_highlights(rig, seen)
    assert same is seen
    assert told == []


def test_deviations_contain_what_is_added_and_it_is_told(ball: tuple[Rig, Geometry]) -> None:
    rig, geometry = ball
    wider, (told,) = follow_highlights(rig, lit(rig, geometry, coloured(rig, geometry, 0.02)))
    assert told.significant
    assert wider.highlight is not None
    assert f"by up to {wider.highlight.max():.2f} of reflectance" in told.sentence
    std = np.full((2, 72, 112), 0.03, np.float32)
    np.testing.assert_allclose(with_highlight(wider, std), np.hypot(std, wider.highlight))
    assert with_highlight(geometry, std) is std


def test_a_highlight_on_a_flat_surface_is_found_although_normals_are_noisy(
    ball: tuple[Rig, Geometry],
) -> None:
    """From pixel to pixel, noise turns them by more than the surface does."""
    rig, geometry = ball
    shape, random = geometry.flags.shape, np.random.default_rng(4)
    normals = np.array([0.1, -0.1, -1.0])[:, None, None] + 0.03 * random.standard_normal((3, *shape))
    normals /= np.linalg.norm(normals, axis=0)
    flat, none = np.full(shape, 720.0), np.zeros(shape, bool)
    surface = replace(geometry.surface, normals=normals.astype(np.float32), edge=none)
    wall = replace(geometry, depth_mm=flat, surface=surface, flags=np.zeros(shape, np.uint16))
    true = np.broadcast_to([[[0.1]], [[-0.1]], [[-1.0]]], normals.shape) / np.sqrt(1.02)
    exact = towards_mirror(rig, replace(wall, surface=replace(surface, normals=true.astype(np.float32))))
    added = Highlight(0.5, 0.4, 0.0, (0.4, 0.4, 0.4)).at(exact)
    seen = lit(rig, wall, np.broadcast_to(YELLOW[:, None, None], (3, *shape)) + added)
    found, (told,) = follow_highlights(rig, seen)
    assert told.significant
    assert found.highlight is not None
    assert float(np.median(found.highlight / added)) == pytest.approx(1.0, abs=0.3)


def test_a_narrow_highlight_on_a_wavy_surface_is_not_found_too_faint(ball: tuple[Rig, Geometry]) -> None:
    """Between neighbours, normals differ by little more than their noise; smoothing hides how they turn."""
    rig, geometry = ball
    shape, random = geometry.flags.shape, np.random.default_rng(7)
    down, across = np.indices(shape)
    true = np.stack([0.1 + 0.25 * np.sin(across / 10), -0.1 + 0.25 * np.sin(down / 10), -np.ones(shape)])
    noisy = true + gaussian_filter(random.standard_normal(true.shape), (0, 1.2, 1.2)) * 0.12
    true, noisy = (each / np.linalg.norm(each, axis=0) for each in (true, noisy))
    surface = replace(geometry.surface, normals=noisy.astype(np.float32), edge=np.zeros(shape, bool))
    relief = replace(
        geometry, depth_mm=np.full(shape, 720.0), surface=surface, flags=np.zeros(shape, np.uint16)
    )
    exact = towards_mirror(rig, replace(relief, surface=replace(surface, normals=true.astype(np.float32))))
    added = Highlight(0.4, 1.5, 0.0, (1.5, 1.5, 1.5)).at(exact)
    found, (told,) = follow_highlights(
        rig, lit(rig, relief, np.broadcast_to(YELLOW[:, None, None], (3, *shape)) + added)
    )
    assert told.significant
    assert found.highlight is not None
    bright = (added > 0.1) & (added < 1)
    assert (added < 1.96 * found.highlight)[bright].mean() > 0.8  # 0.72 by neighbours alone
    # No more than is seen: what the surface sends on of its own is not less than nothing.
    assert found.highlight.max() < 1.02 * (YELLOW.max() + added.max())


def test_too_few_pixels_say_nothing(ball: tuple[Rig, Geometry]) -> None:
    rig, geometry = ball
    towards = towards_mirror(rig, geometry)
    seen = lit(rig, geometry, coloured(rig, geometry, 0.02))
    coarse = replace(seen, flags=np.full_like(seen.flags, int(Flag.SATURATED | Flag.NOT_REFINED)))
    assert find_highlight(rig, coarse, towards) is None


def test_a_saturated_line_is_as_bright_as_its_slopes_say_so_its_pixels_count(
    ball: tuple[Rig, Geometry],
) -> None:
    rig, geometry = ball
    towards = towards_mirror(rig, geometry)
    seen = lit(rig, geometry, coloured(rig, geometry, 0.02))
    saturated = replace(seen, flags=seen.flags | np.uint16(int(Flag.SATURATED)))
    assert find_highlight(rig, saturated, towards) == find_highlight(rig, seen, towards)


def test_a_camera_without_colours_cannot_tell_white_light(ball: tuple[Rig, Geometry]) -> None:
    rig, geometry = ball
    towards = towards_mirror(rig, geometry)
    seen = lit(rig, geometry, coloured(rig, geometry, 0.02))
    grey = rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": "MONO"})})
    assert find_highlight(grey, seen, towards) is None


def test_large_pictures_are_asked_in_slabs_and_say_the_same(
    ball: tuple[Rig, Geometry], monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, geometry = ball
    seen = lit(rig, geometry, coloured(rig, geometry, 0.02))
    whole = find_highlight(rig, seen, towards_mirror(rig, seen))
    monkeypatch.setattr(highlights, "SLAB", 24)
    monkeypatch.setattr(highlights, "MOST_PAIRS", 2500)
    parts = find_highlight(rig, seen, towards_mirror(rig, seen))
    assert whole is not None
    assert parts is not None
    assert parts.roughness == whole.roughness
    assert parts.peak == pytest.approx(whole.peak, rel=0.05)


def before_a_wall(geometry: Geometry) -> Geometry:
    """The ball before a wall, with an edge between them and nothing unknown elsewhere."""
    on_ball = geometry.flags == 0
    edge = binary_dilation(on_ball, iterations=2) & ~on_ball
    return replace(geometry, flags=np.where(edge, int(Flag.DEPTH_EDGE), 0).astype(np.uint16))


def test_a_matt_wall_hides_no_highlight_before_it_and_gets_none(ball: tuple[Rig, Geometry]) -> None:
    """A dark wall is sure of its brightness, and would outweigh the ball."""
    rig, geometry = ball
    both, on_ball = before_a_wall(geometry), geometry.flags == 0
    reflectance = np.where(on_ball, coloured(rig, geometry, 0.02), 0.02)
    wider, told = follow_highlights(rig, lit(rig, both, reflectance))
    assert [finding.name for finding in told] == ["highlights"]
    assert wider.highlight is not None
    added = np.where(on_ball, coloured(rig, geometry, 0.02)[0] - YELLOW[0], 0)
    assert wider.highlight[on_ball].max() == pytest.approx(added.max(), rel=0.25)
    wall = ~binary_dilation(on_ball, iterations=4)
    assert wider.highlight[wall].max() == 0
    # As one surface, the wall says that there is none.
    assert follow_highlights(rig, lit(rig, replace(both, flags=both.flags * 0), reflectance))[1] == []


def test_pixels_at_an_edge_have_the_highlight_of_the_nearest_surface(ball: tuple[Rig, Geometry]) -> None:
    rig, geometry = ball
    wider, _ = follow_highlights(rig, lit(rig, geometry, coloured(rig, geometry, 0.02)))
    assert wider.highlight is not None
    towards = towards_mirror(rig, geometry)
    surfaces = surfaces_between_edges(geometry, towards)
    brightest = np.unravel_index(np.where(geometry.flags == 0, towards, 0).argmax(), towards.shape)
    flags = geometry.flags.copy()
    flags[brightest] = int(Flag.DEPTH_EDGE)
    again, _ = follow_highlights(rig, lit(rig, replace(geometry, flags=flags), coloured(rig, geometry, 0.02)))
    assert again.highlight is not None
    assert again.highlight[brightest] == pytest.approx(wider.highlight[brightest], rel=0.1)
    odd = highlights._everywhere(surfaces[:5, :5], (11, 10))
    assert odd.shape == (11, 10)


def test_where_normals_are_unsure_brightness_says_little_of_highlights(ball: tuple[Rig, Geometry]) -> None:
    rig, geometry = ball
    towards = towards_mirror(rig, geometry)
    surfaces = surfaces_between_edges(geometry, towards)
    seen = lit(rig, geometry, np.full((3, 72, 112), 0.5))
    unsure = replace(seen.surface, shading_rel_std=np.full((72, 112), 0.3, np.float32))
    sure = highlights._pairs(rig, seen, towards, surfaces)
    doubted = highlights._pairs(rig, replace(seen, surface=unsure), towards, surfaces)
    assert sure is not None
    assert doubted is not None
    assert np.median(np.sqrt(doubted.std**2 - sure.std**2)) == pytest.approx(0.3 * 0.5 * 2**0.5, rel=0.01)


@pytest.mark.parametrize(("least", "count"), [("FEWEST_PAIRS", 1000), ("FEWEST_BLOCKS", 100)])
def test_a_small_surface_says_nothing(
    ball: tuple[Rig, Geometry], monkeypatch: pytest.MonkeyPatch, least: str, count: int
) -> None:
    """The ball has some hundred pairs, and the whole picture some thousand."""
    rig, geometry = ball
    monkeypatch.setattr(highlights, least, count)
    reflectance = np.where(geometry.flags == 0, coloured(rig, geometry, 0.02), 0.02)
    assert follow_highlights(rig, lit(rig, before_a_wall(geometry), reflectance))[1] == []


def test_pulls_that_cancel_within_blocks_make_no_peak_surer_than_its_pairs() -> None:
    """Pairs across edges of paint, brighter here and darker there, as often in every block."""
    count = 240
    here = np.tile([1.0, 0.98, 0.96], count // 3)
    far = np.where(np.arange(count) % 4 == 0, 0.5, 0.0) * np.where(np.arange(count) % 8 == 0, 1, -1)
    one = np.ones((3, count))
    pairs = highlights._Pairs(
        here, np.full(count, 0.9), far * one, 0.01 * one, np.arange(count) // 24, np.ones(count, np.int32)
    )
    found = highlights._fitted(pairs, 0.4)
    # Three quarters of the pairs tell the peak; the others pull with two deviations each.
    rise = highlights._lobe(pairs.here, 0.4) - highlights._lobe(pairs.there, 0.4)
    assert abs(found.peak) < found.peak_std
    assert found.peak_std == pytest.approx(0.01 * (4 / 4 / 3 / (0.75**2 * (rise**2).sum())) ** 0.5, rel=0.05)
