"""Light is taken off frames once, or in two steps with the same outcome."""

import numpy as np
import pytest

from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.light.steady import SteadyLight
from dsl_core.reconstruction.merge import LineStack


def _stack() -> LineStack:
    rng = np.random.default_rng(1)
    radiance = rng.uniform(1, 9, (5, 3, 4)).astype(np.float32)
    std = np.full((5, 3, 4), 0.05, np.float32)
    std[0, 0, 0] = np.inf
    return LineStack(radiance, std, np.zeros((3, 4), np.float32))


FIRST = SteadyLight(np.linspace(-0.1, 0.1, 5), np.full(5, 0.02), 0.03, flickers=True)


def test_frames_become_what_they_were_in_other_light() -> None:
    stack, plain = _stack(), _stack()
    FIRST.steady(stack)
    np.testing.assert_allclose(stack.radiance[4], plain.radiance[4] / np.exp(0.1), rtol=1e-6)
    wanted = np.hypot(0.05 / np.exp(0.1), 0.02 * stack.radiance[4])
    np.testing.assert_allclose(stack.std[4], wanted, rtol=1e-5)
    assert np.isinf(stack.std[0, 0, 0])


def test_a_refined_course_gives_the_same_from_frames_that_were_steadied_before() -> None:
    refined = FIRST.refined(np.array([0.01, -0.02, 0.0, 0.03, 0.0]), np.full(5, 0.004))
    at_once, twice = _stack(), _stack()
    refined.steady(at_once)
    FIRST.steady(twice)
    refined.steady(twice, before=FIRST)
    np.testing.assert_allclose(twice.radiance, at_once.radiance, rtol=1e-5)
    np.testing.assert_allclose(twice.std, at_once.std, rtol=1e-3)
    assert refined.white == FIRST.white


def test_what_steadied_frames_are_left_with_is_at_least_a_part_of_their_deviation() -> None:
    surer = FIRST.refined(np.zeros(5), np.zeros(5))
    stack = _stack()
    before = np.float32(0.05)
    unsure = SteadyLight(np.zeros(5), np.full(5, 0.5), 0.0)
    SteadyLight(np.zeros(5), surer.std, 0.0).steady(stack, unsure)
    assert stack.std[1:] == pytest.approx(0.05 * before)


def test_white_is_taken_to_steady_light_with_its_variance() -> None:
    shape = (2, 3)
    white = MergedFrame(
        np.full(shape, 4.0, np.float32), np.full(shape, 0.2, np.float32), np.zeros(shape, bool)
    )
    steady = FIRST.steady_white(white)
    assert steady.radiance == pytest.approx(4 * np.exp(-0.03), rel=1e-6)
    assert steady.variance == pytest.approx(0.2 * np.exp(-0.06), rel=1e-6)
