"""Lateral colour of both lenses: half a pixel between red and blue at the side of a full-size picture."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.simulation.foreign.lenses import BLUE_NM, RED_NM, camera_of_colour, projector_magnification
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.published_rig import published_rig

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
