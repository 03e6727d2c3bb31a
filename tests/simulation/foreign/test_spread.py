"""Sampled spreads: light is kept, and moments are those of the shape."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.simulation.foreign.spread import BLUR_RATIO, CORNER_RATIO, FINE, Spread
from dsl_core.simulation.foreign.variants import Foreign

SHAPES = ("plain", "spread-square", "spread-skew")


def spread(*names: str) -> Spread:
    return Spread(0.6, Foreign(frozenset(names or ("plain",))))


def moments(light: np.ndarray, reach: int) -> tuple[float, float, float]:
    x = np.arange(-reach, reach + 1) / FINE
    mean = float(light @ x)
    second, third = (float(light @ (x - mean) ** k) for k in (2, 3))
    return mean, second, third / second**1.5


@pytest.mark.parametrize("name", SHAPES)
def test_a_point_keeps_its_light_its_middle_and_the_usual_variance(name: str) -> None:
    point = spread(name).point()
    mean, variance, skewness = moments(point, spread(name).reach)
    assert point.sum() == pytest.approx(1)
    assert mean == pytest.approx(0, abs=1e-3)
    assert variance == pytest.approx(0.36, rel=0.01)
    assert (abs(skewness) > 0.3) == (name == "spread-skew")


def test_a_square_spread_is_flatter_and_ends_earlier_than_a_gaussian() -> None:
    usual, square = spread().point(), spread("spread-square").point()
    middle, px = spread().reach, FINE
    assert square[middle] < 0.9 * usual[middle]
    assert square[middle + 3 * px // 2] < 0.3 * usual[middle + 3 * px // 2]


def test_tails_blur_and_width_are_those_stated() -> None:
    assert moments(spread("blur").point(), spread("blur").reach)[1] == pytest.approx(
        0.36 * BLUR_RATIO**2, rel=0.01
    )
    tails = spread("spread-tails")
    assert moments(tails.point(), tails.reach)[1] == pytest.approx(0.36 * (7 + 9) / 8, rel=0.01)
    corners = spread("spread-corners")
    assert moments(corners.point(1.4), corners.reach)[1] == pytest.approx(0.36 * 1.4**2, rel=0.01)


def test_a_lit_pixel_is_one_inside_wide_bands() -> None:
    for name in (*SHAPES, "spread-tails", "blur"):
        pixel = spread(name).pixel()
        assert pixel[:: spread(name).reach].size  # samples line up with whole pixels
        assert pixel.reshape(-1)[:-1].reshape(-1, FINE).sum(0) == pytest.approx(np.ones(FINE), abs=2e-3)


def test_all_shapes_together_are_an_equal_mixture() -> None:
    both = spread("spread-square", "spread-skew")
    parts = [spread(name).point() for name in ("spread-square", "spread-skew")]
    assert both.point() == pytest.approx(sum(parts) / 2)


def test_widths_rise_to_the_corners_only_where_asked() -> None:
    size = (640, 360)
    assert spread().widths == (1.0,)
    corners = spread("spread-corners")
    assert corners.widths[-1] == CORNER_RATIO
    at = corners.width_at(np.array([319.5, 639.5, -0.5]), np.array([179.5, 359.5, 179.5]), size)
    assert at == pytest.approx([1.0, CORNER_RATIO, 1 + (CORNER_RATIO - 1) / 2], abs=1e-6)
