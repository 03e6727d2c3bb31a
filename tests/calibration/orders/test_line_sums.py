"""Sums over lines and pixels are those that arrays give."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.orders.line_sums import histograms, take_out, window_sums, zero_sums

RNG = np.random.default_rng(5)
SHAPE = (7, 5)
RADIANCE, EXPECTED, SLOPE, STD = (RNG.uniform(0.5, 2.0, SHAPE) for _ in range(4))
DISTANCE = RNG.uniform(-10, 10, SHAPE)
AMPLITUDE, OFFSET = RNG.uniform(1, 2, 5), RNG.uniform(0, 1, 5)


def test_light_is_summed_where_lines_are_near_and_where_none_is_lit() -> None:
    near, unlit = np.abs(DISTANCE) < 4, (np.abs(DISTANCE) > 5) & (np.abs(DISTANCE) < 8)
    found = zero_sums(RADIANCE, EXPECTED, DISTANCE, 4.0, (5.0, 8.0))
    wanted = [(part * use).sum(0) for use in (near, unlit) for part in (RADIANCE, EXPECTED, np.ones(SHAPE))]
    assert found == pytest.approx(np.array(wanted))


def test_the_zero_order_is_taken_out_and_its_lever_summed_near_lines() -> None:
    signal, variance, sums = take_out(RADIANCE, STD, EXPECTED, SLOPE, DISTANCE, AMPLITUDE, OFFSET, 4.0)
    left = RADIANCE - OFFSET - AMPLITUDE * EXPECTED
    lever = AMPLITUDE * SLOPE * (np.abs(DISTANCE) < 4)
    assert signal == pytest.approx(left)
    assert variance == pytest.approx(STD**2)
    assert sums == pytest.approx([(lever**2).sum(), (lever * left).sum(), ((lever * STD) ** 2).sum()])


def test_a_window_holds_the_lines_around_its_centre() -> None:
    centre = RNG.uniform(-5, 5, 5)
    inside = np.abs(DISTANCE - centre) < 3
    light, noise = window_sums(RADIANCE, STD, DISTANCE, centre, 3.0)
    assert light == pytest.approx((RADIANCE * inside).sum(0))
    assert noise == pytest.approx((STD * inside).sum(0))


def test_histograms_sum_by_cell_and_distance_between_the_ends() -> None:
    cell = np.array([0, 1, -1, 1, 0])
    found = histograms(RADIANCE, STD, AMPLITUDE, DISTANCE, cell, 2, (-6.0, 7.0), 0.5)
    assert found.shape == (2, 3, 27)
    wanted = np.zeros((2, 3, 27))
    for f, p in np.ndindex(SHAPE):
        if cell[p] >= 0 and -6 < DISTANCE[f, p] < 7:
            k = int((DISTANCE[f, p] + 6) // 0.5)
            wanted[cell[p], :, k] += RADIANCE[f, p], STD[f, p], AMPLITUDE[p]
    assert found == pytest.approx(wanted)
