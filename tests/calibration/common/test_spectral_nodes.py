"""Corrections of curves have a node every ten nanometres, and smoothness is searched in even ratios."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.common.spectral_nodes import NODES_NM, SMOOTHNESS


def test_nodes_are_every_ten_nanometres_of_the_visible_range() -> None:
    assert (NODES_NM[0], NODES_NM[-1], len(NODES_NM)) == (400.0, 700.0, 31)
    assert np.diff(NODES_NM).tolist() == [10.0] * 30


def test_lengths_and_noise_are_doubled_and_amplitudes_tripled() -> None:
    assert SMOOTHNESS["lengths"] == tuple(20.0 * 2**k for k in range(4))
    assert SMOOTHNESS["noise_factors"] == tuple(2.0**k for k in range(4))
    assert SMOOTHNESS["amplitudes"] == pytest.approx([0.1 * 10 ** (-k / 2) for k in (3, 2, 1, 0)], rel=0.06)
