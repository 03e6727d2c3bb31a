"""Gains of colours are told from curves that are off, as far as their deviations say."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.reconstruction.spectral.probing.colour_gains import CURVE_STD, ColourGains, colour_gains

PIXELS, OTHERS, KNOTS, LEVEL = 50, 2, 9, 2e3
PRIOR = np.full(OTHERS, 0.2)


def equations(red: float, blue: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels that know of each knot only what differs from colour to colour; curves are a little off."""
    rng = np.random.default_rng(seed)
    contrast = np.kron(np.eye(3) - 1 / 3, np.eye(KNOTS))
    normal = np.zeros((OTHERS + 3 * KNOTS, OTHERS + 3 * KNOTS))
    normal[:OTHERS, :OTHERS], normal[OTHERS:, OTHERS:] = np.eye(OTHERS), contrast
    normal = LEVEL * np.broadcast_to(normal, (PIXELS, *normal.shape))
    curves = CURVE_STD * rng.standard_normal(3 * KNOTS) + np.repeat([red, 0.0, blue], KNOTS)
    truth = np.r_[np.full(OTHERS, 0.1), curves]
    noise = np.sqrt(LEVEL) * rng.standard_normal((PIXELS, len(truth)))
    noise[:, OTHERS:] = noise[:, OTHERS:] @ contrast
    return normal, normal @ truth + noise, np.ones(PIXELS)


def test_gains_are_found_within_deviations_that_hold_for_curves_that_are_off() -> None:
    off = []
    for seed in range(200):
        found = colour_gains(*equations(0.08, -0.12, seed), PRIOR)
        assert found is not None
        value, std = found.apart
        assert std < 0.03
        off.append((value + 0.2) / std)
    assert np.std(off) == pytest.approx(1.0, rel=0.15)
    assert abs(np.mean(off)) < 0.3


def test_pixels_that_know_too_little_say_nothing() -> None:
    normal, score, weight = equations(0.08, 0.1)
    assert colour_gains(normal, score, 1e-6 * weight, PRIOR) is None
    assert colour_gains(normal, score, 0 * weight, PRIOR) is None


def test_blue_is_compared_with_red_and_what_both_share_says_nothing() -> None:
    gains = ColourGains(0.04, 0.1, np.array([[4e-4, 1e-4], [1e-4, 4e-4]]))
    assert gains.apart == pytest.approx((0.06, 6e-4**0.5))
    assert ColourGains(0.24, 0.3, gains.covariance).apart == pytest.approx(gains.apart)
