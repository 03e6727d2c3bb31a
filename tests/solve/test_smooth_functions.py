"""Smooth functions are found from what is linear in them, with deviations that hold."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.solve.smooth_functions import (
    AMPLITUDES,
    LENGTHS,
    Equations,
    SmoothPrior,
    SmoothSolution,
    hat_functions,
    log_determinant,
    matern,
    solve_given,
    solve_smooth,
)

NODES = np.linspace(400.0, 700.0, 31)


def draw(seed: int, noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A smooth truth, averages of it over four nodes each, and the weights."""
    rng = np.random.default_rng(seed)
    truth = 0.3 + 0.05 * np.sin(NODES / 40.0) + 0.0005 * (NODES - 550)
    design = np.zeros((60, len(NODES)))
    for row in design:
        first = rng.integers(0, len(NODES) - 4)
        row[first : first + 4] = 0.25
    return truth, design, design @ truth + noise * rng.standard_normal(60)


@pytest.mark.slow
def test_function_is_found_within_its_stated_deviation() -> None:
    sigmas = []
    for seed in range(8):
        truth, design, seen = draw(seed, 0.002)
        found = solve_smooth(Equations.of(design, seen, np.full(60, 0.002)), [SmoothPrior(NODES, 1.0, 1.0)])
        sigmas.append((found.values - truth) / found.std)
        assert np.abs(found.values - truth)[2:-2].max() < 0.006
    assert 0.6 < np.sqrt(np.mean(np.square(sigmas))) < 1.4


@pytest.mark.parametrize("factor", [1.0, 1.4, 2.0, 3.0, 4.0, 6.0, 8.0, 16.0, 32.0, 64.0])
def test_evidence_finds_by_how_much_noise_was_understated(factor: float) -> None:
    _, design, seen = draw(1, 0.0)
    # Residuals of exactly the deviation they are meant to have, so that chance plays no part.
    noise = np.random.default_rng(0).standard_normal(60)
    noise -= design @ np.linalg.lstsq(design, noise, rcond=None)[0]
    noise *= 1 / np.sqrt(noise @ noise / (60 - np.linalg.matrix_rank(design)))
    found = solve_smooth(
        Equations.of(design, seen + factor * 0.001 * noise, np.full(60, 0.001)),
        [SmoothPrior(NODES, 1.0, 1.0)],
    )
    assert found.noise_factor == pytest.approx(factor, rel=0.1)


def test_evidence_sees_that_noise_was_understated() -> None:
    truth, design, seen = draw(1, 0.02)
    found = solve_smooth(Equations.of(design, seen, np.full(60, 0.002)), [SmoothPrior(NODES, 1.0, 1.0)])
    assert found.noise_factor == pytest.approx(10.0, rel=0.5)
    assert np.sqrt(np.mean(((found.values - truth) / found.std) ** 2)) < 2.0


def test_common_unknown_keeps_its_prior_where_data_say_nothing() -> None:
    _, design, seen = draw(2, 0.002)
    wide = np.hstack([design, np.zeros((60, 1))])
    found = solve_smooth(Equations.of(wide, seen, np.full(60, 0.002)), [SmoothPrior(NODES, 1.0, 1.0)], [0.5])
    assert found.values[-1] == pytest.approx(0.0, abs=1e-12)
    assert found.std[-1] == pytest.approx(0.5)


def test_parts_of_the_equations_add_up() -> None:
    _, design, seen = draw(3, 0.002)
    std = np.full(60, 0.002)
    first, second = (Equations.of(design[p], seen[p], std[p]) for p in (slice(0, 25), slice(25, 60)))
    whole, both = Equations.of(design, seen, std), first + second
    np.testing.assert_allclose(both.normal, whole.normal, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(both.right, whole.right, rtol=1e-9, atol=1e-6)
    assert both.square == pytest.approx(whole.square)
    assert both.count == whole.count
    prior = SmoothPrior(NODES, 1.0, 1.0).covariance(0.05, 60.0)
    np.testing.assert_allclose(
        solve_given(both, prior, 1.0).values, solve_given(whole, prior, 1.0).values, rtol=1e-6
    )
    rest = whole - second
    np.testing.assert_allclose(rest.normal, first.normal, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(rest.right, first.right, rtol=1e-9, atol=1e-6)
    assert rest.square == pytest.approx(first.square)
    assert rest.count == first.count


def bessel_matern(distance: np.ndarray) -> np.ndarray:
    """Matern correlation of smoothness 5/2 from its general definition by a Bessel function."""
    from scipy.special import gamma, kv

    d = np.sqrt(5.0) * np.abs(distance) + 1e-12
    return np.asarray(2**-1.5 / gamma(2.5) * d**2.5 * kv(2.5, d))


def test_correlation_is_that_of_smoothness_five_halves() -> None:
    distance = np.array([-3.0, -0.4, 0.02, 0.5, 1.0, 2.0, 7.0])
    np.testing.assert_allclose(matern(distance), bessel_matern(distance), rtol=1e-6)
    assert matern(np.zeros(1)) == 1.0


def evidence_of(amplitude: float, length: float) -> tuple[Equations, list[SmoothPrior]]:
    """Ten functions drawn with an amplitude and a length on nodes 10 apart, and seen with little noise."""
    nodes, std = np.arange(0.0, 301.0, 10.0), 0.02 * amplitude
    correlation = bessel_matern(np.subtract.outer(nodes, nodes) / length)
    root = np.linalg.cholesky(correlation + 1e-9 * np.eye(len(nodes)))
    unit = np.random.default_rng(7).standard_normal((2, 10, len(nodes)))
    seen = (amplitude * unit[0] @ root.T + std * unit[1]).ravel()
    equations = Equations.of(np.eye(seen.size), seen, np.full(seen.size, std))
    return equations, [SmoothPrior(nodes, 0.01 * amplitude, 0.01 * amplitude)] * 10


def prior_of_first(found: SmoothSolution, functions: list[SmoothPrior]) -> NDArray[np.float64]:
    """The chosen prior of the first function's values."""
    count = len(functions[0].nodes)
    return found.prior[:count, :count]


@pytest.mark.parametrize("length", [15.0, 30.0, 60.0, 120.0, 240.0])
def test_evidence_finds_the_length_that_functions_were_drawn_with(length: float) -> None:
    equations, functions = evidence_of(0.1, length)
    found = solve_smooth(equations, functions, amplitudes=(0.1,), noise_factors=(1.0,))
    assert prior_of_first(found, functions) == pytest.approx(functions[0].covariance(0.1, length))


@pytest.mark.parametrize("amplitude", [0.001, 0.003, 0.01, 0.03, 0.1, 0.3])
def test_evidence_finds_the_amplitude_that_functions_were_drawn_with(amplitude: float) -> None:
    equations, functions = evidence_of(amplitude, 60.0)
    found = solve_smooth(equations, functions, lengths=(60.0,), noise_factors=(1.0,))
    assert prior_of_first(found, functions) == pytest.approx(functions[0].covariance(amplitude, 60.0))


def test_lengths_are_an_octave_apart_and_amplitudes_half_a_decade() -> None:
    """Between two candidates the evidence differs little, so finer ones would cost time for nothing."""
    assert np.diff(np.log2(LENGTHS)) == pytest.approx(1.0)
    assert np.diff(np.log10(AMPLITUDES)) == pytest.approx(0.5, abs=0.03)


def test_hats_interpolate_between_nodes_and_hold_their_ends() -> None:
    at = np.array([395.0, 400.0, 402.5, 555.0, 700.0, 730.0])
    values = np.sin(NODES / 30)
    np.testing.assert_allclose(hat_functions(at, NODES) @ values, np.interp(at, NODES, values), atol=1e-12)


def test_level_and_rise_are_as_unsure_as_stated() -> None:
    covariance = SmoothPrior(NODES, 0.5, 0.2).covariance(0.0, 60.0)
    ends = np.zeros(len(NODES))
    ends[[0, -1]] = -1, 1
    assert ends @ covariance @ ends == pytest.approx(0.2**2)
    middle = np.zeros(len(NODES))
    middle[[0, -1]] = 0.5
    assert middle @ covariance @ middle == pytest.approx(0.5**2)


def test_the_rise_is_that_over_all_nodes_whatever_their_unit() -> None:
    metres = SmoothPrior(1e-9 * NODES, 0.5, 0.2).covariance(0.0, 60e-9)
    assert metres == pytest.approx(SmoothPrior(NODES, 0.5, 0.2).covariance(0.0, 60.0))


@pytest.mark.parametrize("size", [1, 2, 7, 40])
def test_the_determinant_is_that_of_numpy_whatever_the_sign_and_the_matrix_left_as_it_was(size: int) -> None:
    matrix = np.random.default_rng(size).normal(size=(size, size))
    before = matrix.copy()
    assert log_determinant(matrix) == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-9)
    assert log_determinant(-matrix) == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-9)
    assert np.array_equal(matrix, before)
