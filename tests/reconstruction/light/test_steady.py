"""Light is taken off frames once, or in two steps with the same outcome."""

import numpy as np

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
