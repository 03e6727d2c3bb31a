"""Black, captured again, that is as bright as white in a part of the picture: a window came in."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.again.lit_again import LitAgain, lit_again
from dsl_core.capture.proof.noise import Noise
from dsl_core.model.rig import Sensor
from tests.cases.repeated_white import PLAN, RASTER, SIZE, WHITE_DN, WHITES, rasters


def window(light_dn: float) -> NDArray[np.float64]:
    light = np.zeros(SIZE[::-1])
    light[12:24, 32:48] = light_dn
    return light


def found(covers: NDArray[np.float64], since: int = 0, at_first: bool = False) -> LitAgain | None:
    """With a window over pictures from one on, or from the beginning on."""

    def light_of(is_white: bool, is_later: bool) -> NDArray[np.float64]:
        light = np.full(SIZE[::-1], WHITE_DN if is_white else 0.0)
        return np.where(covers > 0, covers, light) if is_later or at_first else light

    channels = RASTER.channels("RGGB")
    return lit_again(PLAN, rasters(light_of, since), channels, Noise.of(Sensor(), 12), RASTER)


def test_a_window_that_came_in_is_told_with_its_place_and_its_first_picture() -> None:
    seen = found(window(1.3 * WHITE_DN), since=WHITES[1])
    assert seen is not None
    assert seen.shot.index == WHITES[1]
    assert f"By frame {WHITES[1] + 1}, black has become as bright as white" in seen.sentence
    assert "in columns 32-48, rows 12-24 of the picture" in seen.sentence


@pytest.mark.parametrize("light_dn", [0.0, 0.2 * WHITE_DN])
def test_pictures_without_one_and_faint_light_of_the_room_are_no_window(light_dn: float) -> None:
    assert found(window(light_dn), since=WHITES[0]) is None


def test_what_was_there_from_the_first_picture_on_did_not_come_in() -> None:
    assert found(window(1.3 * WHITE_DN), at_first=True) is None


def test_where_white_alone_has_lost_light_black_has_not_become_bright() -> None:
    lit = window(0.8 * WHITE_DN)

    def light_of(is_white: bool, is_later: bool) -> NDArray[np.float64]:
        gain = np.where(lit > 0, 0.1 if is_later else 0.6, 1.0) * WHITE_DN
        return lit + (gain if is_white else 0.0)

    channels, noise = RASTER.channels("RGGB"), Noise.of(Sensor(), 12)
    assert lit_again(PLAN, rasters(light_of, WHITES[0]), channels, noise, RASTER) is None
