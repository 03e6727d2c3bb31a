"""Lateral colour of lenses is half a pixel at the side; filters seen at an angle move to the blue."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.sensor import bayer_channels
from dsl_core.simulation.bandpass_filters import true_transmission
from dsl_core.simulation.foreign.lenses import (
    BLUE_NM,
    INDEX,
    RED_NM,
    TILT_DEG,
    camera_of_colour,
    centre_ratio,
    projector_magnification,
)
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import SimCamera, open_twin

COLOUR, PLAIN = (Foreign(frozenset({name})) for name in ("lateral-colour", "plain"))


def test_red_and_blue_are_half_a_pixel_apart_at_the_side() -> None:
    lens = published_rig().camera
    red, green, blue = (camera_of_colour(lens, channel, COLOUR) for channel in range(3))
    assert (red.fx_px - blue.fx_px) / lens.fx_px * lens.width_px / 2 == pytest.approx(0.5)
    assert (red.fy_px - blue.fy_px) / lens.fy_px * lens.width_px / 2 == pytest.approx(0.5)
    assert green == lens
    assert camera_of_colour(lens, 0, PLAIN) == lens
    small = lens.resized(222, 145)
    assert camera_of_colour(small, 0, COLOUR).fx_px / small.fx_px == pytest.approx(red.fx_px / lens.fx_px)


def test_the_projector_magnifies_by_wavelength() -> None:
    width = published_rig().projector.width_px
    blue, red = projector_magnification(np.array([BLUE_NM, RED_NM]), COLOUR)
    assert (red - blue) * width / 2 == pytest.approx(0.5)
    assert (projector_magnification(np.array([BLUE_NM, RED_NM]), PLAIN) == 1).all()


LENS = published_rig().camera.resized(96, 64)
TILTED = Foreign(frozenset({"filter-angle"}))


def test_the_band_moves_by_some_nanometres_at_the_side() -> None:
    shift = 550 * (1 - centre_ratio(LENS, TILTED).reshape(64, 96))
    row = shift[32]
    assert row.min() == pytest.approx(0, abs=0.05)
    assert 3 < row[0] < 8
    assert 3 < row[-1] < 8
    # The least shift is where the filter's normal points: 3 degrees to the right.
    rays = pixel_rays(LENS)[:, 32]
    normal = np.degrees(np.arctan2(rays[0], rays[2]))
    assert normal[int(row.argmin())] == pytest.approx(TILT_DEG, abs=0.4)
    angle = np.radians(normal[0] - TILT_DEG)
    assert row[0] == pytest.approx(550 * np.sin(angle) ** 2 / (2 * INDEX**2), rel=0.1)
    assert (centre_ratio(LENS, Foreign(frozenset({"plain"}))) == 1).all()


@pytest.mark.slow
def test_the_first_order_of_a_line_moves_to_columns_of_bluer_light() -> None:
    """Through a filter a white line has a narrow image in the first order; it moves with the band."""
    images = {}
    for name in ("plain", "filter-angle"):
        camera = open_twin({"foreign": name, "size": "96x64", "scene": "plane"}).camera
        assert isinstance(camera, SimCamera)
        image = np.zeros((360, 640, 3), np.uint8)
        image[:, 160:165] = 255
        camera.world.show(image)
        images[name] = camera.world.renderer.through(true_transmission(600.0)).expected(image)
    middle = {}
    for name, picture in images.items():
        green = picture[32:34].sum(0)
        x = np.arange(96)
        order = green * (x < 30)
        middle[name] = float((order * x).sum() / order.sum())
    assert abs(middle["filter-angle"] - middle["plain"]) > 0.02


def test_truth_beside_a_jump_is_that_of_the_pixels_own_colour() -> None:
    truths = {}
    for foreign in ("plain", "lateral-colour"):
        camera = open_twin({"size": "64x48", "scene": "color-checker", "foreign": foreign}).camera
        assert isinstance(camera, SimCamera)
        world = camera.world
        truths[foreign] = world.truth, world.truth_of_colours
    assert truths["plain"][0] is truths["plain"][1]
    green, own = truths["lateral-colour"]
    moved = ~np.isclose(own.depth_mm, green.depth_mm, atol=5)
    mosaic = bayer_channels("RGGB", 48, 64)
    assert 0 < moved.sum() < 60
    assert not moved[mosaic == 1].any()
    red = camera_of_colour(world.rig.camera, 0, COLOUR)
    wanted = world.scene.render(red, world.rig.pose.projector_centre_mm)
    for name in ("depth_mm", "material", "lit"):
        assert np.array_equal(
            getattr(own, name)[mosaic == 0], getattr(wanted, name)[mosaic == 0], equal_nan=name == "depth_mm"
        )
