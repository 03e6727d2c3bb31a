"""Outlines between the two ends of a drag."""

from __future__ import annotations

import numpy as np
import pytest
from dsl_app.results.outline_box import ellipse, rectangle


@pytest.mark.parametrize(
    "ends", [((2.2, 5.4), (4.1, 8.6)), ((4.1, 8.6), (2.2, 5.4)), ((2.2, 8.6), (4.1, 5.4))]
)
def test_a_rectangle_holds_whole_pixels_however_it_is_drawn(
    ends: tuple[tuple[float, float], tuple[float, float]],
) -> None:
    assert rectangle(*ends) == ((1.5, 4.5), (4.5, 4.5), (4.5, 9.5), (1.5, 9.5))


def test_an_ellipse_fills_its_rectangle() -> None:
    corners = np.array(ellipse((2.0, 5.0), (11.0, 8.0)))
    np.testing.assert_allclose([corners.min(0), corners.max(0)], [(1.5, 4.5), (11.5, 8.5)], atol=0.01)
    offsets = (corners - (6.5, 6.5)) / (5.0, 2.0)
    np.testing.assert_allclose(np.hypot(*offsets.T), 1.0)
