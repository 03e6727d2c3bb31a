"""Bandpass filters seen at an angle: the band moves to the blue with the sine squared."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.bandpass_filters import true_transmission
from dsl_core.simulation.foreign.filter_angle import INDEX, TILT_DEG, centre_ratio
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import SimCamera, open_twin

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
