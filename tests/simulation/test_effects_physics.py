"""What the renderings of effects promise, against closed forms and conservation of light."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from dsl_core.simulation.effects.base import LightPath, make_view
from dsl_core.simulation.effects.catalogue import EXTRAS, Choice, with_effects
from dsl_core.simulation.effects.depth_of_field import DepthOfField, gaussian_distance, layers
from dsl_core.simulation.effects.lens import Glare
from dsl_core.simulation.effects.patches import Patches
from dsl_core.simulation.effects.specular import highlight
from dsl_core.simulation.effects.subsurface import profile, stays, within
from dsl_core.simulation.rendering.renderer import Renderer
from dsl_core.simulation.scenes.truth import Finish
from tests.cases.effect_scenes import HEIGHT, SIZE, WIDTH, pictures, world_of

WHITE = np.full((HEIGHT, WIDTH), 255, np.uint8)
IMAGES = pictures(np.random.default_rng(8))


def only(path: LightPath, name: str) -> LightPath:
    """The plain renderer with one further effect."""
    return replace(path, extras=tuple(extra for extra in EXTRAS if extra.name == name))


def test_the_usual_twin_is_the_plain_renderer() -> None:
    world = world_of("steps")
    plain = Renderer(world.rig, world.truth)
    assert isinstance(world.renderer, Renderer)
    for image in IMAGES:
        assert np.array_equal(world.renderer.expected(image), plain.expected(image))


def test_three_colours_hold_the_mosaic() -> None:
    world = world_of("sphere")
    plain = Renderer(world.rig, world.truth)
    for image in IMAGES:
        planes, mosaic = plain.planes(image), plain.expected(image)
        assert np.array_equal(planes[0, ::2, ::2], mosaic[::2, ::2])
        assert np.array_equal(planes[2, 1::2, 1::2], mosaic[1::2, 1::2])


def test_all_effects_left_out_but_the_usual_ones_give_the_plain_picture() -> None:
    world = world_of("box")
    path = with_effects(world.everything(), Choice.of("usual").names or ())
    assert np.array_equal(make_view(path).expected(IMAGES[0]), world.renderer.expected(IMAGES[0]))


@pytest.mark.parametrize("spread_px", [0.3, 1.0, 4.0])
def test_a_profile_keeps_all_light_and_spreads_it_as_far_as_it_should(spread_px: float) -> None:
    weights = profile(spread_px)
    assert weights.sum() == pytest.approx(1.0)
    assert weights.min() >= 0
    middle = len(weights) // 2
    assert weights[middle, middle] == pytest.approx(stays(spread_px))
    x = np.arange(len(weights)) - middle
    inside = weights[np.hypot(x, x[:, None]) <= 3 * spread_px + 2].sum()
    assert inside == pytest.approx(within(3 * spread_px + 2, spread_px), abs=0.04)


def test_even_light_on_wax_stays_as_it_is() -> None:
    path = only(world_of("wax").everything(), "subsurface")
    stage, wax = path.extras[0].step(path), path.truth.material == 0
    even = np.broadcast_to(np.where(wax, 100.0, 7.0).astype(np.float32), (3, *wax.shape))
    assert stage.apply(even, WHITE) == pytest.approx(even, rel=1e-5)


def test_light_on_wax_leaves_beside_a_line_and_elsewhere_stays() -> None:
    path = only(world_of("wax").everything(), "subsurface")
    stage, wax = path.extras[0].step(path), path.truth.material == 0
    columns = np.flatnonzero(wax[SIZE[1] // 2])
    line = np.zeros((3, *wax.shape), np.float32)
    lit = columns[len(columns) // 4]
    line[:, :, lit] = 100.0
    spread = stage.apply(line, WHITE)
    row = spread[0, SIZE[1] // 2]
    assert 10 < row[lit] < 99
    assert 0.1 < row[lit + 1] < row[lit]
    assert not spread[:, ~wax & (line[0] == 0)].any()


def test_the_highlight_is_where_the_mirror_would_be_and_dims_with_roughness() -> None:
    light = np.array([100.0, 0.0, 0.0])
    points = np.stack([np.linspace(0, 100, 101), np.zeros(101), np.full(101, 700.0)])
    normals = np.broadcast_to([[0.0], [0.0], [-1.0]], points.shape)
    smooth, rough = (highlight(Finish(gloss=0.04, roughness=r), points, normals, light) for r in (0.2, 0.5))
    assert smooth.argmax() == 50
    # At the mirror's place: D = 1 / (pi alpha^2), F nearly the gloss, and masking nearly one.
    assert smooth.max() == pytest.approx(0.04 / (4 * 0.2**4), rel=0.02)
    assert rough.max() == pytest.approx(0.04 / (4 * 0.5**4), rel=0.02)


def test_a_glossy_ball_is_brighter_at_its_highlight_only() -> None:
    path = world_of("sphere gloss=0.04").everything()
    shiny = make_view(only(path, "specular")).expected(WHITE)
    matte = make_view(replace(path, extras=())).expected(WHITE)
    gain = shiny - matte
    ball = path.truth.material == 0
    assert not gain[~ball].any()
    assert gain.max() > 0.2 * matte[ball].max()
    assert np.median(gain[ball]) < 0.1 * gain.max()


def test_form_factors_of_squares_at_a_right_angle() -> None:
    # Two unit squares with a common edge: 0.20004 (J. R. Howell, catalogue of configuration factors, C-14).
    at = (np.arange(12) + 0.5) / 12
    u, v = (part.ravel() for part in np.meshgrid(at, at))
    count, zero = u.size, np.zeros(u.size)
    floor, wall = np.stack([u, v, zero]), np.stack([u, zero, v])
    up, along = np.array([[0.0], [0], [1]]), np.array([[0.0], [1], [0]])
    patches = Patches(
        np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.concatenate([floor, wall], 1),
        np.concatenate([np.repeat(up, count, 1), np.repeat(along, count, 1)], 1),
        np.full(2 * count, 1 / count), np.zeros((1, 1, 6), np.int64), 1,
    )  # fmt: skip
    factors = patches.form_factors()
    assert factors[:count, count:].sum(1).mean() == pytest.approx(0.20004, rel=0.03)
    assert not factors[:count, :count].any()
    assert factors == pytest.approx(factors.T, abs=1e-9)


def test_the_floor_of_a_box_takes_the_colour_of_its_walls() -> None:
    path = world_of("box").everything()
    lit, alone = (
        make_view(p).planes(WHITE) for p in (only(path, "interreflection"), replace(path, extras=()))
    )
    gain = (lit - alone) / np.maximum(alone, 1e-3)
    assert (lit - alone).min() >= 0
    floor = (path.truth.material == 0) & (path.truth.normals[2] < -0.9) & path.truth.lit
    columns = np.where(floor, np.arange(SIZE[0]), -1)
    left = floor & (columns <= columns.max() * 0.35)
    right = floor & (columns >= columns.max() * 0.75)
    # Red on the left, green on the right.
    assert gain[0, left].mean() / gain[1, left].mean() > 1.1 * gain[0, right].mean() / gain[1, right].mean()
    assert 0.02 < gain[1, floor].mean() < 1


def test_a_plane_gets_no_light_from_itself() -> None:
    path = world_of("plane tilt_y_deg=30").everything()
    lit, alone = (
        make_view(p).expected(WHITE) for p in (only(path, "interreflection"), replace(path, extras=()))
    )
    assert np.array_equal(lit, alone)


def test_what_stands_between_two_walls_keeps_their_light_apart() -> None:
    world = world_of("relief")
    patches = Patches.of(world.rig, world.truth)
    factors = patches.form_factors()
    seen = patches.visible(factors, world.scene.surfaces)
    hidden = factors[~seen].sum() / factors.sum()
    assert np.array_equal(seen, seen.T)
    assert 0.001 < hidden < 0.9


def test_the_circle_of_confusion_is_that_of_a_thin_lens() -> None:
    world = world_of("steps step_mm=60 depth_mm=600")
    effect = DepthOfField(camera_aperture_mm=3.0)
    sigma = effect.blurs(world.everything()).camera_px
    depth, focus = world.truth.depth_mm, float(np.median(world.truth.depth_mm))
    # An image distance of nearly the focal length: diameter A f (z - f0) / (z f0).
    expected = 0.25 * 3.0 * world.rig.camera.fx_px * np.abs(depth - focus) / (depth * focus)
    assert sigma == pytest.approx(expected)
    assert not DepthOfField().blurs(world_of("plane").everything()).camera_px.any()


def test_layers_share_every_pixel() -> None:
    levels, weights = layers(np.linspace(0, 1.3, 60).reshape(6, 10))
    assert np.sum(weights, 0) == pytest.approx(np.ones((6, 10)), rel=1e-6)
    variance = np.sum([level**2 * weight for level, weight in zip(levels, weights, strict=True)], 0)
    assert variance.ravel() == pytest.approx(np.linspace(0, 1.3, 60) ** 2, abs=1e-6)


@pytest.mark.parametrize(("narrow", "wide"), [(0.6, 0.61), (0.6, 0.9), (0.6, 3.0)])
def test_the_distance_of_two_blurs_is_reached_and_not_passed(narrow: float, wide: float) -> None:
    per_px = 200
    x = np.arange(-20 * per_px, 20 * per_px + 1) / per_px
    narrow_bell, wide_bell = (
        np.exp(-0.5 * (x / s) ** 2) / (s * math.sqrt(2 * math.pi)) for s in (narrow, wide)
    )
    best = (np.maximum(narrow_bell - wide_bell, 0)).sum() / per_px
    assert gaussian_distance(narrow, wide) == pytest.approx(best, rel=1e-2)
    picture = np.random.default_rng(1).random(4000) > 0.5
    blurred = [gaussian_filter1d(picture.repeat(20).astype(float), 20 * s) for s in (narrow, wide)]
    assert np.abs(blurred[0] - blurred[1]).max() <= gaussian_distance(narrow, wide) * 1.01


def test_deep_steps_blur_away_from_the_focus_only() -> None:
    path = world_of("steps step_mm=80 depth_mm=560").everything()
    image = IMAGES[2]
    blurred, sharp = (
        make_view(p).expected(image) for p in (only(path, "depth-of-field"), replace(path, extras=()))
    )
    effect = DepthOfField()
    focused = effect.blurs(path).projector_px < 0.02
    change = np.abs(blurred - sharp)
    assert focused.sum() > 50
    assert change[~focused].mean() > 8 * change[focused].mean()


def test_glare_spreads_a_share_of_the_mean_of_each_colour() -> None:
    path = world_of("plane").everything()
    flat = replace(path, extras=(Glare(share=0.1),))
    veiled, clear = (make_view(p).expected(IMAGES[0]) for p in (flat, replace(path, extras=())))
    gain = veiled - clear
    green = clear[::2, 1::2].sum() + clear[1::2, ::2].sum()
    assert gain[0, 0] == pytest.approx(0.1 * clear[::2, ::2].mean(), rel=1e-3)
    assert gain[0, 1] == pytest.approx(0.1 * green / (clear.size / 2), rel=1e-3)
