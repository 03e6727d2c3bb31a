"""White of pictures in fractions is where their values end, whatever a few sparks are."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.io.pictures.float_scale import FloatScale

RAMP = np.linspace(0, 0.8, 10000, dtype=np.float32).reshape(100, 100)


def test_values_that_end_at_one_value_are_limited_by_it() -> None:
    scale = FloatScale()
    scale.add(RAMP / 2)
    scale.add((RAMP * 2).clip(0, 1))
    assert scale.white == 1.0


def test_there_is_room_above_the_largest_value_of_what_no_sensor_limited() -> None:
    scale = FloatScale()
    scale.add(RAMP)
    scale.add(RAMP[::-1])
    assert scale.white == pytest.approx(0.84)


def test_a_few_sparks_do_not_take_the_bits_of_all_others() -> None:
    sparks = RAMP.copy()
    sparks[40, :9] = np.geomspace(30, 3000, 9)
    scale = FloatScale()
    scale.add(sparks)
    scale.add(RAMP)
    assert scale.white == pytest.approx(2.1 * 0.8, rel=1e-3)


@pytest.mark.parametrize("most", [0.0, np.inf, np.nan])
def test_white_is_unknown_where_no_value_says_it(most: float) -> None:
    scale = FloatScale()
    scale.add(np.full((5, 5), most, np.float32))
    assert scale.white is None
