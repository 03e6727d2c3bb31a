"""Frames of foreign twins: the usual light where nothing is foreign, and the stated difference elsewhere."""

from __future__ import annotations

import ast
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

import dsl_core.simulation.foreign.renderer as module
from dsl_core.optics.correspondence import zero_order
from dsl_core.simulation.foreign.spread import Spread
from dsl_core.simulation.foreign.transport import Frame
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import SimCamera, open_twin
from dsl_core.simulation.world import World

Floats = NDArray[np.float64]


@lru_cache(maxsize=8)
def twin(foreign: str, size: str = "64x42", film: str = "on", scene: str = "plane") -> World:
    camera = open_twin({"foreign": foreign, "size": size, "film": film, "scene": scene}).camera
    assert isinstance(camera, SimCamera)
    return camera.world


def picture(world: World, image: NDArray[np.uint8]) -> Floats:
    world.show(image)
    return world.rate().astype(np.float64) - world.path.ambient_dn_per_ms


def black(world: World) -> NDArray[np.uint8]:
    lens = world.rig.projector
    return np.zeros((lens.height_px, lens.width_px, 3), np.uint8)


def line(world: World, start: int, width: int = 1, level: int = 255) -> NDArray[np.uint8]:
    image = black(world)
    image[:, start : start + width] = level
    return image


def columns_px(world: World, scale: float = 1.0) -> Floats:
    """Projector column of the zero order at every pixel; ``scale`` magnifies the camera."""
    lens = world.rig.camera
    lens = lens.model_copy(update={"fx_px": lens.fx_px * scale, "fy_px": lens.fy_px * scale})
    rig = world.rig.model_copy(update={"camera": lens})
    depth = torch.as_tensor(world.truth.depth_mm.ravel())
    found: Floats = zero_order(rig, torch.arange(len(depth)), depth)[0].numpy().reshape(-1)
    return found


def inside_rows(world: World, border_px: float = 3.0) -> NDArray[np.bool_]:
    """Pixels whose zero order comes from rows that are not at the top or bottom of the frame."""
    depth = torch.as_tensor(world.truth.depth_mm.ravel())
    row = zero_order(world.rig, torch.arange(len(depth)), depth)[1].numpy().reshape(-1)
    return np.asarray((row > border_px) & (row < world.rig.projector.height_px - 1 - border_px))


def free_image(world: World) -> NDArray[np.uint8]:
    """Colours that differ along columns and rows both."""
    rng = np.random.default_rng(5)
    height, width = black(world).shape[:2]
    tiles = rng.integers(0, 256, (height // 20, width // 20, 3)).astype(np.uint8)
    return np.kron(tiles, np.ones((20, 20, 1), np.uint8))


def pattern(world: World, kind: str) -> NDArray[np.uint8]:
    image = black(world)
    match kind:
        case "line":
            return line(world, 300, 5)
        case "stripes":
            image[:, (np.arange(image.shape[1]) // 8) % 2 == 0] = 204
        case "colours":
            image[:, :, 0], image[:, ::7, 2] = 128, 255
        case "rows":
            image[(np.arange(image.shape[0]) // 8) % 2 == 0] = 255
        case "free":
            return free_image(world)
    return image


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["line", "stripes", "colours", "rows", "free", "black"])
@pytest.mark.parametrize("scene", ["plane", "color-checker"])
def test_with_nothing_foreign_the_light_is_that_of_the_usual_renderer(kind: str, scene: str) -> None:
    """Two ways to one picture: closed form and sampling.

    The usual renderer leaves out first orders where the zero order would come from beyond the frame, and
    ends sharply at the frame's top and bottom.
    """
    usual, plain = twin("", "48x32", scene=scene), twin("plain", "48x32", scene=scene)
    ours, theirs = (picture(world, pattern(world, kind)) for world in (plain, usual))
    lit = (theirs > 1e-6 * theirs.max()) & inside_rows(usual).reshape(theirs.shape)
    ours, theirs = ours[lit], theirs[lit]
    error = np.abs(ours - theirs)
    assert np.sqrt((error**2).mean()) < 0.004 * theirs.max()
    # Free patterns are tables of four samples a pixel in both.
    assert np.quantile(error, 0.99) < (0.02 if kind == "free" else 0.01) * theirs.max()
    assert ours.sum() == pytest.approx(theirs.sum(), rel=0.003)


def test_a_pattern_and_its_inverse_add_up_to_white_at_the_edge_of_the_frame_too() -> None:
    """Whichever way they vary: a check of frames relies on it."""
    world = twin("spread-tails", film="off")
    stripes = np.zeros_like(line(world, 0))
    stripes[:, ::2] = 255
    bars = np.zeros_like(stripes)
    bars[::2] = 255
    white = picture(world, np.full_like(stripes, 255)) + picture(world, black(world))
    for pattern_shown in (stripes, bars):
        both = picture(world, pattern_shown) + picture(world, 255 - pattern_shown)
        np.testing.assert_allclose(both, white, atol=0.01 * white.max())


def test_light_from_far_beyond_the_frame_takes_no_room() -> None:
    """The ray search of a steeply bent film may end anywhere."""
    frame = Frame((640, 360), published_rig().projector_response, Spread(0.7, Foreign(frozenset())), True)
    along = torch.tensor([[100.0, 1e9], [100.0, -1e9]])
    found = frame._spread(along, torch.full_like(along, 100.0), torch.ones_like(along), "columns")
    assert found.sum(1).tolist() == pytest.approx([1.0, 1.0], abs=1e-4)
    assert found.argmax(1).tolist() == [100, 100]


def test_through_a_filter_both_agree_too() -> None:
    from dsl_core.simulation.bandpass_filters import true_transmission

    usual, plain = twin(""), twin("plain")
    image = line(usual, 200, 5)
    for world in (usual, plain):
        world.show(image)
    curve = true_transmission(550.0)
    ours, theirs = (world.renderer.through(curve).expected(image) for world in (plain, usual))
    assert np.abs(ours - theirs).max() < 0.02 * theirs.max()
    first = columns_px(usual).reshape(theirs.shape) < 150
    assert ours[first].sum() == pytest.approx(theirs[first].sum(), rel=0.01)


def measured_spread(foreign: str, start: int = 330) -> tuple[float, float, float, float]:
    """Mean, variance, skewness of a line's light in the zero order, and the share beyond 2.5 px."""
    world = twin(foreign, "320x24", film="off")
    white = picture(world, line(world, 0, 640))
    light = (picture(world, line(world, start)) / np.maximum(white, 1e-9)).ravel()
    x = columns_px(world) - start
    near = np.abs(x) < 12
    order = np.argsort(x[near])
    x, light = x[near][order], light[near][order] - world.rig.projector_response.black_fraction
    total = np.trapezoid(light, x)
    mean = np.trapezoid(light * x, x) / total
    moments = [float(np.trapezoid(light * (x - mean) ** k, x) / total) for k in (2, 3)]
    beyond = float(np.trapezoid(light * (np.abs(x) > 2.5), x) / total)
    return float(mean), moments[0] - 1 / 12, moments[1] / moments[0] ** 1.5, beyond


@pytest.mark.slow
def test_spreads_have_the_moments_that_they_say() -> None:
    """Variance of the spread (the lit pixel's own taken off), skewness and tails, read off one frame."""
    std = published_rig().projector_response.blur_px
    usual = measured_spread("plain")
    assert usual[0] == pytest.approx(0, abs=0.02)
    assert usual[1] == pytest.approx(std**2, rel=0.03)
    for name in ("spread-square", "spread-skew"):
        mean, variance, skewness, _ = measured_spread(name)
        assert mean == pytest.approx(0, abs=0.02), name
        assert variance == pytest.approx(std**2, rel=0.04), name
        assert (abs(skewness) > 0.15) == (name == "spread-skew"), name
    assert measured_spread("blur")[1] == pytest.approx((1.08 * std) ** 2, rel=0.03)
    tails = measured_spread("spread-tails")
    assert tails[1] == pytest.approx((7 / 8 + 9 / 8) * std**2, rel=0.04)
    assert tails[3] > usual[3] + 0.015


def test_spread_widens_towards_the_corners_only() -> None:
    std = published_rig().projector_response.blur_px
    middle, side = (measured_spread("spread-corners", start) for start in (320, 520))
    # The camera's 24 rows see rows near the middle of the frame's height.
    assert middle[1] == pytest.approx(std**2, rel=0.1)
    assert side[1] > 1.1 * middle[1]


@pytest.mark.slow
def test_lateral_colour_magnifies_red_and_blue_differently() -> None:
    """An edge moves in opposite ways in red and blue, by less than both lenses can at the side."""
    world = twin("lateral-colour", "320x24", film="off")
    usual = twin("plain", "320x24", film="off")
    shifts = {}
    for channel, led in ((0, 0), (2, 2)):
        edge = black(world)
        edge[:, 400:, led] = 255
        seen = [np.asarray(w.renderer.planes(edge)[channel], float) for w in (world, usual)]
        row = seen[0].shape[0] // 2
        # Camera column where the light of the edge passes half of white.
        places = []
        for picture_ in seen:
            profile = picture_[row] / picture_[row].max()
            i = int(np.flatnonzero(np.diff((profile > 0.5).astype(int)))[0])
            places.append(i + (0.5 - profile[i]) / (profile[i + 1] - profile[i]))
        shifts[channel] = places[0] - places[1]
    assert shifts[0] * shifts[2] < 0
    # Half a pixel of the full picture at its side is a fifth of one here, and the edge is near the middle.
    assert 0.004 < abs(shifts[0] - shifts[2]) < 0.4


@pytest.mark.slow
def test_noise_free_frames_do_not_depend_on_the_seed_of_the_noise_but_on_that_of_the_rig() -> None:
    def frame(**options: str) -> NDArray[np.uint16]:
        camera = open_twin({"foreign": "prnu,curves", "size": "32x24", "noise": "off", **options}).camera
        assert isinstance(camera, SimCamera)
        camera.world.show(line(camera.world, 100, 300))
        return camera.world.expose(100.0, 1)

    assert np.array_equal(frame(), frame())
    assert np.array_equal(frame(), frame(seed="4"))
    assert not np.array_equal(frame(truth="1"), frame(truth="2"))


def test_foreign_light_shares_no_profile_with_the_solver() -> None:
    """No module of the room imports the closed form, nor what the solver builds on it."""
    for path in Path(module.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                assert node.module is not None
                assert "line_profile" not in node.module, path.name
                assert "pixel_model" not in node.module, path.name
                assert "reconstruction" not in node.module, path.name
                assert node.module != "scipy.special", path.name
