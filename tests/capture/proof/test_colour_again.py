"""White, captured again, in another colour: a lamp or a display that changes one colour and not another."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.colour_again import ColourAgain, colour_again
from dsl_core.capture.proof.noise import Noise
from dsl_core.model.rig import Sensor
from tests.cases.repeated_white import PLAN, RASTER, SIZE, WHITE_DN, WHITES, rasters


def of_colours(red: float, green: float, blue: float) -> NDArray[np.float64]:
    """A mosaic (rows, columns) with these values of red, green and blue pixels."""
    mosaic = np.full(SIZE[::-1], green)
    mosaic[::2, ::2], mosaic[1::2, 1::2] = red, blue
    return mosaic


def found(
    red: float, green: float, blue: float, since: int = 0, light: NDArray[np.float64] | float = WHITE_DN
) -> ColourAgain | None:
    """With so many times the light of each colour in whites from one on."""

    def light_of(is_white: bool, is_later: bool) -> NDArray[np.float64] | float:
        return light * (of_colours(red, green, blue) if is_later else 1.0) if is_white else 0.0

    return colour_again(PLAN, rasters(light_of, since), Noise.of(Sensor(), 12), RASTER.channels("RGGB"))


def test_white_in_another_colour_is_told_with_the_light_of_each() -> None:
    seen = found(1.05, 1.0, 0.94, since=WHITES[-1])
    assert seen is not None
    assert seen.shot.index == WHITES[-1]
    assert seen.ratios == pytest.approx((1.05, 1.0, 0.94), abs=0.003)
    assert seen.apart == pytest.approx(0.06, abs=0.003)
    assert f"captured again as frame {WHITES[-1] + 1}, has another colour" in seen.sentence
    assert "1.05 times in red, 1.00 times in green, 0.94 times in blue" in seen.sentence


@pytest.mark.parametrize("colours", [(0.9, 0.9, 0.9), (1.01, 1.0, 0.99), (1.0, 1.0, 1.0)])
def test_light_that_all_colours_lose_is_no_change_of_colour(colours: tuple[float, float, float]) -> None:
    assert found(*colours) is None


def test_a_colour_that_saturates_or_is_missing_says_nothing() -> None:
    bright = of_colours(5000.0, WHITE_DN, WHITE_DN)
    seen = found(0.5, 1.0, 0.9, light=bright)
    assert seen is not None
    assert "in red" not in seen.sentence
    assert found(0.5, 1.0, 1.0, light=of_colours(0.5, WHITE_DN, WHITE_DN)) is None
    assert found(1.0, 1.0, 0.9, light=of_colours(WHITE_DN, 5000.0, WHITE_DN)) is None


def test_light_that_noise_outshines_says_nothing() -> None:
    assert found(1.0, 1.0, 0.9, light=0.3) is None


def test_a_colour_that_saturates_only_later_says_nothing() -> None:
    seen = found(1.5, 1.0, 0.9, light=of_colours(3500.0, WHITE_DN, WHITE_DN))
    assert seen is not None
    assert "in red" not in seen.sentence


def test_what_little_of_white_does_not_saturate_says_nothing() -> None:
    light = np.full(SIZE[::-1], 5000.0)
    light[:, :4] = 2.0
    assert found(1.0, 0.0, 1.0, light=light) is None
