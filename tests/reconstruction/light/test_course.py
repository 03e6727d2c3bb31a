"""The course of the light from witnesses: a drift is found, chance is not, and flicker is told from both."""

import numpy as np
import pytest

from dsl_core.reconstruction.light.course import Witness, light_course

SHOTS = 200


def witnesses(drift: float, flicker: float, seed: int = 1) -> list[Witness]:
    """Of 80 lines at two settings relative to white, and of white taken again at the end."""
    rng = np.random.default_rng(seed)
    log = drift * np.arange(SHOTS) / (SHOTS - 1) + flicker * rng.normal(size=SHOTS)
    noise = 0.003 * rng.normal(size=SHOTS)
    white = 0.05
    found = [Witness(110 + k, None, log[110 + k] - white + noise[k], 0.003, k / 40 - 1) for k in range(80)]
    found += [
        Witness(20 + k, 110 + k, log[20 + k] - log[110 + k] + noise[100 + k], 0.003, between_settings=True)
        for k in range(80)
    ]
    return [*found, Witness(199, 15, log[199] - log[15] + noise[199], 0.001)]


def test_steady_light_is_left_alone() -> None:
    for seed in range(20):
        course = light_course(witnesses(0.0, 0.0, seed), SHOTS)
        assert course is not None
        assert course.is_steady
        assert not course.log.any() or np.abs(course.log).max() < 1e-4


def test_a_drift_is_measured_from_the_first_shot_on() -> None:
    course = light_course(witnesses(-0.1, 0.0), SHOTS)
    assert course is not None
    assert course.drifts
    assert not course.flickers
    truth = -0.1 * np.arange(SHOTS) / (SHOTS - 1)
    assert np.abs(course.log - truth).max() < 0.006
    assert abs(course.drift + 0.1) < 3 * course.drift_std + 0.002


def test_flicker_is_not_taken_for_drift() -> None:
    course = light_course(witnesses(0.0, 0.06), SHOTS)
    assert course is not None
    assert course.flickers
    assert not course.drifts
    assert course.flicker == pytest.approx(0.06, rel=0.3)
    assert course.white == pytest.approx(0.05, abs=0.02)


def test_too_few_witnesses_say_nothing() -> None:
    assert light_course(witnesses(0.0, 0.0)[:3], SHOTS) is None
