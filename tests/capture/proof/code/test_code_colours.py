"""Pairs of a code in another colour than white: colours changed while the code was captured."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_colours import CodeColours, code_colours
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.rig import Sensor
from tests.cases.repeated_white import BLACK_DN, RASTER, SIZE

PAIRS, WHITE_DN = 8, 900.0


def of_colours(red: float, green: float, blue: float) -> NDArray[np.float64]:
    mosaic = np.full(SIZE[::-1], green)
    mosaic[::2, ::2], mosaic[1::2, 1::2] = red, blue
    return mosaic


def found(
    colours: tuple[float, float, float], changed: int, white_dn: NDArray[np.float64] | float = WHITE_DN
) -> CodeColours | None:
    """With so many times the light of each colour in the first ``changed`` pairs of eight."""
    rng = np.random.default_rng(1)

    def taken(light: NDArray[np.float64] | float) -> Counts:
        pixels = BLACK_DN + light + rng.normal(0, 4, SIZE[::-1])
        return RASTER.take(np.rint(pixels).clip(0, 4095).astype(np.uint16))

    pairs = {}
    for number in range(PAIRS):
        light = white_dn * (of_colours(*colours) if number < changed else np.ones(SIZE[::-1]))
        stripes = np.arange(SIZE[0]) // 2 ** (number % 4) % 2
        pairs[number] = (taken(light * stripes), taken(light * (1 - stripes)))
    ends = (taken(white_dn * np.ones(SIZE[::-1])), taken(0.0))
    return code_colours(pairs, ends, Noise.of(Sensor(), 12), RASTER.channels("RGGB"))


def test_pairs_before_a_change_of_colour_are_told_with_the_light_of_each() -> None:
    seen = found((0.93, 1.0, 1.06), 3)
    assert seen is not None
    assert seen.pairs == 3
    assert seen.ratios == pytest.approx((0.93, 1.0, 1.06), abs=0.004)
    assert "0.93 times in red, 1.00 times in green, 1.06 times in blue" in seen.sentence


@pytest.mark.parametrize("colours", [(1.0, 1.0, 1.0), (0.9, 0.9, 0.9), (1.01, 1.0, 0.99), (1.07, 1.05, 1.05)])
def test_light_that_all_colours_lose_is_no_change_of_colour(colours: tuple[float, float, float]) -> None:
    assert found(colours, 4) is None


def test_one_pair_alone_is_a_wrong_picture_and_a_colour_that_saturates_says_nothing() -> None:
    assert found((0.9, 1.0, 1.1), 1) is None
    bright = of_colours(5000.0, WHITE_DN, WHITE_DN)
    assert found((0.5, 1.0, 1.0), 4, bright) is None
