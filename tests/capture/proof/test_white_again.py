"""White, captured again, that is darker in a part of the picture alone: dust, or something in the way."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.white_again import WhiteAgain, white_again
from dsl_core.model.rig import Sensor
from tests.cases.repeated_white import PLAN, RASTER, SIZE, WHITE_DN, WHITES, rasters


def found(
    later: NDArray[np.float64] | float, since: int = 0, more: NDArray[np.float64] | float = 0.0
) -> WhiteAgain | None:
    """With so many times the light (rows, columns) in whites from one on, and so much ``more`` black, DN."""

    def light_of(is_white: bool, is_later: bool) -> NDArray[np.float64] | float:
        light = (WHITE_DN if is_white else 0.0) * (later if is_later else 1.0)
        return light + (more if is_later else 0.0)

    return white_again(PLAN, rasters(light_of, since), Noise.of(Sensor(), 12), RASTER)


def spot(share: float) -> NDArray[np.float64]:
    light = np.ones(SIZE[::-1])
    light[12:24, 32:48] = share
    return light


def test_a_part_of_white_that_has_become_darker_is_told_with_its_place() -> None:
    seen = found(0.96 * spot(0.9), since=WHITES[-1])
    assert seen is not None
    assert (seen.shot.index, seen.columns, seen.rows) == (WHITES[-1], (32, 48), (12, 24))
    assert (seen.share, seen.usual) == pytest.approx((0.96 * 0.9, 0.96), abs=0.01)
    assert f"captured again as frame {WHITES[-1] + 1}, has" in seen.sentence
    assert "in columns 32-48, rows 12-24 of the picture, and 0.96 times in most of it" in seen.sentence


def test_bands_of_rows_are_light_that_flickers_and_no_dust() -> None:
    down = np.arange(SIZE[1])[:, None] / SIZE[1]
    seen, dust = found(1 + 0.15 * np.sin(2 * np.pi * 2.3 * down)), found(spot(0.85))
    assert seen is not None
    assert dust is not None
    assert (seen.is_banded, dust.is_banded) == (True, False)
    assert "the light flickers" in seen.sentence
    assert "dust or moisture" in dust.sentence


@pytest.mark.parametrize("share", [1.0, 0.7, 1.2])
def test_a_lamp_that_fades_does_so_everywhere_and_black_is_taken_off(share: float) -> None:
    assert found(share, more=200.0 * (1 - spot(0.0))) is None


def test_a_part_that_differs_by_less_than_a_twentieth_is_no_matter() -> None:
    assert found(spot(0.97)) is None
    assert found(spot(0.93)) is not None
