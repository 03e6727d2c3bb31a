"""Patches of surfaces exchange light as closed forms say."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.simulation.effects.patches import Patches


def test_form_factors_of_squares_at_a_right_angle() -> None:
    # Two unit squares with a common edge: 0.20004 (J. R. Howell, catalogue of configuration factors, C-14).
    at = (np.arange(12) + 0.5) / 12
    u, v = (part.ravel() for part in np.meshgrid(at, at))
    count, zero = u.size, np.zeros(u.size)
    floor, wall = np.stack([u, v, zero]), np.stack([u, zero, v])
    up, along = np.array([[0.0], [0], [1]]), np.array([[0.0], [1], [0]])
    patches = Patches(
        np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.concatenate([floor, wall], 1),
        np.concatenate([np.repeat(up, count, 1), np.repeat(along, count, 1)], 1),
        np.full(2 * count, 1 / count), np.zeros((1, 1, 6), np.int64), 1,
    )  # fmt: skip
    factors = patches.form_factors()
    assert factors[:count, count:].sum(1).mean() == pytest.approx(0.20004, rel=0.03)
    assert not factors[:count, :count].any()
    assert factors == pytest.approx(factors.T, abs=1e-9)
