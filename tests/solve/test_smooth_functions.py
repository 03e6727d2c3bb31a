"""Smooth functions are found from what is linear in them, with deviations that hold."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.solve.smooth_functions import Equations, SmoothPrior, solve_given, solve_smooth

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
    whole = Equations.of(design, seen, std)
    prior = SmoothPrior(NODES, 1.0, 1.0).covariance(0.05, 60.0)
    np.testing.assert_allclose(
        solve_given(first + second, prior, 1.0).values, solve_given(whole, prior, 1.0).values, rtol=1e-6
    )
    rest = whole - second
    np.testing.assert_allclose(rest.normal, first.normal, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(rest.right, first.right, rtol=1e-9, atol=1e-6)
    assert rest.square == pytest.approx(first.square)
    assert rest.count == first.count
