"""Single pixels of black, captured again, that are far off: a bad cable or a hot sensor."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.again.single_pixels import SinglePixels, single_pixels
from dsl_core.capture.proof.noise import Noise
from dsl_core.model.rig import Sensor
from tests.cases.repeated_white import PLAN, RASTER, SIZE, WHITE_DN, WHITES, rasters


def found(more: NDArray[np.float64], since: int = 0) -> SinglePixels | None:
    """With ``more`` in every black that is captured again from one on, DN."""

    def light_of(is_white: bool, is_later: bool) -> NDArray[np.float64] | float:
        return WHITE_DN if is_white else more * is_later

    return single_pixels(PLAN, rasters(light_of, since), Noise.of(Sensor(), 12), RASTER)


def spread(count: int, more_dn: float) -> NDArray[np.float64]:
    more = np.zeros(SIZE[::-1])
    more[np.arange(count) * 3 % SIZE[1], np.arange(count) * 7 % SIZE[0]] = more_dn
    return more


@pytest.mark.parametrize("more_dn", [256.0, -200.0])
def test_pixels_that_are_far_off_alone_are_told(more_dn: float) -> None:
    seen = found(spread(12, more_dn), since=WHITES[-1])
    assert seen is not None
    assert seen.share == pytest.approx(12 / (SIZE[0] * SIZE[1]))
    assert seen.most_dn == pytest.approx(abs(more_dn), abs=20)
    assert f"captured again as frame {seen.shot.number}, 0.39% of the pixels" in seen.sentence
    assert PLAN.original(seen.shot).role == "black"


def test_light_that_falls_on_neighbours_noise_and_a_few_pixels_are_no_matter() -> None:
    spot = np.zeros(SIZE[::-1])
    spot[12:24, 32:48] = 300.0
    assert found(spot) is None
    assert found(spread(12, 0.0)) is None
    assert found(spread(5, 256.0)) is None
