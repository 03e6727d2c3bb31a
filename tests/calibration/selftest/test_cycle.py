"""The colour cycle is found, with and without time stamps, and told from steady light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.selftest.cycle import (
    advised_exposures,
    find_cycle,
    find_cycle_by_spread,
    has_trusted_times,
)
from tests.cases.cycle_readings import BLACK_DN, MIX, led_time_ms, short_exposures, table


@pytest.mark.parametrize("hz", [24.3, 50.0, 60.0, 75.0, 120.0, 180.0, 240.1])
def test_the_fundamental_is_found_and_no_harmonic(hz: float) -> None:
    scores = []
    for seed in range(3):
        period = find_cycle(short_exposures(hz, seed, jitter_ms=0.5), BLACK_DN).period_ms
        assert period is not None
        assert period.value == pytest.approx(1000 / hz, rel=1e-3)
        scores.append((period.value - 1000 / hz) / period.std)
    assert np.abs(scores).max() < 4


@pytest.mark.parametrize("hz", [40.0, 60.0, 120.0])
def test_a_wave_without_harmonics_is_no_slower_cycle(hz: float) -> None:
    readings = short_exposures(hz)
    wave = np.sin(2 * np.pi * (hz * readings.timestamp_s[:, None] - np.arange(3) / 3))
    noise = 1e-3 * np.random.default_rng(1).standard_normal((96, 3))
    period = find_cycle(
        replace(readings, mean_dn=BLACK_DN + 300 * (1 + 0.3 * wave + noise)), BLACK_DN
    ).period_ms
    assert period is not None
    assert period.value == pytest.approx(1000 / hz, rel=1e-3)


def test_a_weak_cycle_is_found_with_its_depth() -> None:
    full = find_cycle(short_exposures(60.0), BLACK_DN)
    weak = find_cycle(short_exposures(60.0, depth=0.05), BLACK_DN)
    assert weak.period_ms is not None
    assert weak.period_ms.value == pytest.approx(1000 / 60, rel=1e-3)
    assert weak.modulation.value == pytest.approx(0.05 * full.modulation.value, rel=0.1)


def test_steady_light_is_steady_and_its_bound_holds() -> None:
    found = find_cycle(short_exposures(60.0, depth=0.0), BLACK_DN)
    assert found.is_steady
    assert 3e-4 < found.modulation.value < 3e-3
    assert not find_cycle(short_exposures(60.0, depth=0.02), BLACK_DN).is_steady


def test_light_that_varies_at_random_has_no_period() -> None:
    readings = short_exposures(60.0, depth=0.0)
    flicker = 1 + 0.1 * np.random.default_rng(3).standard_normal((96, 1))
    found = find_cycle(replace(readings, mean_dn=BLACK_DN + 300 * flicker * np.ones(3)), BLACK_DN)
    assert found.period_ms is None
    assert not found.is_steady


@pytest.mark.parametrize("hz", [50.0, 60.0, 120.0])
def test_the_spread_of_repeats_finds_the_cycle_without_time_stamps(hz: float) -> None:
    rng = np.random.default_rng(5)
    exposures = np.repeat([*np.geomspace(3, 60, 40), *np.linspace(62, 200, 16)], 8)
    light = led_time_ms(hz, 1000 * rng.random(len(exposures)), exposures) @ MIX / 10
    noise = 1 + 3e-4 * rng.standard_normal(light.shape)
    found = find_cycle_by_spread(table(exposures, BLACK_DN + light * noise), BLACK_DN).period_ms
    assert found is not None
    assert found.value == pytest.approx(1000 / hz, rel=2e-3)
    assert abs(found.value - 1000 / hz) < 4 * found.std


def test_spreads_without_a_cycle_give_no_period() -> None:
    exposures = np.repeat(np.geomspace(3, 60, 40), 8)
    rng = np.random.default_rng(6)
    flicker = 1 + 0.1 * rng.standard_normal((len(exposures), 1))
    found = find_cycle_by_spread(
        table(exposures, BLACK_DN + exposures[:, None] * flicker * [20, 30, 25]), BLACK_DN
    )
    assert found.period_ms is None
    quiet = 1 + 1e-4 * rng.standard_normal((len(exposures), 3))
    assert find_cycle_by_spread(
        table(exposures, BLACK_DN + 20 * exposures[:, None] * quiet), BLACK_DN
    ).is_steady


def test_time_stamps_are_trusted_only_where_they_follow_the_waits() -> None:
    readings = short_exposures(60.0)
    assert has_trusted_times(readings)
    assert not has_trusted_times(replace(readings, timestamp_s=np.zeros(96)))
    assert not has_trusted_times(replace(readings, timestamp_s=np.arange(96) / 30.0))


def test_advised_exposures_hold_whole_cycles() -> None:
    assert advised_exposures(20.0, (160.0, 329.0, 1.0)) == (160.0, 320.0, 20.0)
