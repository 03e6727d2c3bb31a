import numpy as np
import pytest

from dsl_core.solve.robust import huber_weights, robust_linear, robust_std


def test_the_robust_deviation_is_that_of_normal_values_in_spite_of_wrong_ones() -> None:
    values = np.random.default_rng(3).normal(0, 2.0, 20_000)
    values[:1000] = 1e6
    assert robust_std(values) == pytest.approx(2.0, rel=0.08)
    both = robust_std(np.stack([values, 3 * values], 1), 0)
    assert both[1] == pytest.approx(3 * both[0], rel=1e-12)


def test_huber_weights_are_inverse_variances_near_zero_and_fall_off_beyond_the_limit() -> None:
    sigma = np.full(6, 0.5)
    weight, scale = huber_weights(np.array([0.0, 0.1, -0.1, 0.2, -0.2, 5.0]), sigma, 2.0)
    assert scale == 1.0
    assert weight[:5] == pytest.approx(4.0)
    # Ten deviations off, with a limit of two: a fifth of the weight.
    assert weight[5] == pytest.approx(4.0 / 5)


def test_residuals_that_scatter_more_than_stated_widen_the_deviation() -> None:
    residual = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    weight, scale = huber_weights(residual, np.full(5, 0.1), 3.0)
    assert scale == pytest.approx(14.82602)
    assert weight == pytest.approx(1 / (1.4826022185 * 1.0) ** 2)


def test_a_linear_fit_leaves_out_what_is_far_off_and_states_its_own_scatter() -> None:
    rng = np.random.default_rng(3)
    x = np.linspace(-1, 1, 400)
    design = np.stack([x, np.ones_like(x)], 1)
    values = design @ [0.5, 2.0] + rng.normal(0, 0.01, len(x))
    values[::8] += 3.0
    found, inverse, scatter = robust_linear(design, values)
    assert found == pytest.approx([0.5, 2.0], abs=0.004)
    assert scatter == pytest.approx(0.012, abs=0.003)
    assert scatter * inverse[0, 0] ** 0.5 == pytest.approx(0.01 / np.sqrt((x**2).sum()), rel=0.5)
