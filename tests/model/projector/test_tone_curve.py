"""Light by drive level: a curve as coefficients, and a projector that has one instead of its power law."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from dsl_core.model.projector.tone_curve import ToneCurve
from dsl_core.model.rig import ProjectorResponse

LEVELS = np.array([0.0, 0.05, 0.1, 0.2, 0.5, 0.8, 1.0])


def test_one_coefficient_is_a_power_law() -> None:
    curve = ToneCurve(coefficients=(2.2,), lowest_level=0.1)
    assert curve.light(LEVELS) == pytest.approx(LEVELS**2.2)


def test_a_curve_is_a_sum_of_powers_of_the_logarithm_and_goes_on_as_at_its_lowest_level() -> None:
    curve = ToneCurve(coefficients=(2.0, -0.1, 0.05), lowest_level=0.1)
    x = np.log(LEVELS[2:])
    assert curve.light(LEVELS[2:]) == pytest.approx(np.exp(2 * x - 0.1 * x**2 + 0.05 * x**3))
    at, below = np.log(0.1), float(curve.light(np.array(0.05)))
    slope = 2.0 - 0.2 * at + 0.15 * at**2
    assert below == pytest.approx(float(curve.light(np.array(0.1))) * 0.5**slope)
    assert curve.light(np.zeros((2, 3))).tolist() == [[0.0] * 3] * 2


def test_light_that_falls_with_more_drive_is_no_curve() -> None:
    with pytest.raises(ValidationError, match="more drive must never give less light"):
        ToneCurve(coefficients=(-0.1,), lowest_level=0.1)
    # Its slope, 1 + x, is negative between drive levels of 0.1 and 0.37.
    with pytest.raises(ValidationError, match="use fewer of them"):
        ToneCurve(coefficients=(1.0, 0.5), lowest_level=0.1)
    ToneCurve(coefficients=(1.0, 0.5), lowest_level=0.4)


def test_the_radiance_of_a_projector_is_that_of_its_curve_where_it_has_one() -> None:
    curve = ToneCurve(coefficients=(1.5, -0.2), lowest_level=0.1, rel_std=0.002)
    ours = ProjectorResponse(gamma=1.7, tone=curve, black_fraction=0.01)
    light = curve.light(np.array(51 / 255))
    assert float(ours.radiance(0.2)) == pytest.approx(0.01 + 0.99 * float(light))
    assert float(ours.radiance(0.0)) == 0.01
    assert float(ours.radiance(1.0)) == 1.0
    assert ProjectorResponse.model_validate_json(ours.model_dump_json()) == ours


def test_a_projector_that_was_saved_without_a_curve_follows_its_power_law() -> None:
    old = ProjectorResponse.model_validate_json('{"gamma": 2.0, "black_fraction": 0.0}')
    assert old.tone is None
    assert float(old.radiance(0.4)) == pytest.approx(0.4**2)
