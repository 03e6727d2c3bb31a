"""The colour cycle is found, with and without time stamps, and told from steady light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from dsl_core.calibration.selftest.camera import Transfer
from dsl_core.calibration.selftest.cycle import (
    _coarse,
    _cost,
    _cost_of,
    _design,
    _fine,
    _nearest,
    _parameters,
    _residual,
    _spreads,
    _step,
    _worthwhile,
    advised_exposures,
    check_beats,
    find_cycle,
    find_cycle_by_spread,
    has_trusted_times,
)
from dsl_core.calibration.selftest.readings import RegionSizes
from dsl_core.model.calibration.selftest import Measured
from tests.cases.cycle_readings import BLACK_DN, MIX, led_time_ms, short_exposures, table


@pytest.mark.slow
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
    assert found.modulation.value == pytest.approx(3 * found.modulation.std)
    assert not find_cycle(short_exposures(60.0, depth=0.02), BLACK_DN).is_steady


def test_light_that_varies_at_random_has_no_period() -> None:
    readings = short_exposures(60.0, depth=0.0)
    flicker = 1 + 0.1 * np.random.default_rng(3).standard_normal((96, 1))
    found = find_cycle(replace(readings, mean_dn=BLACK_DN + 300 * flicker * np.ones(3)), BLACK_DN)
    assert found.period_ms is None
    assert not found.is_steady


@pytest.mark.slow
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
    # Of the eight repeats of an exposure, seven tell how much they differ.
    assert found.modulation.std == pytest.approx(found.modulation.value / np.sqrt(14))
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


def test_harmonics_of_a_frequency_leave_what_least_squares_leave() -> None:
    rng = np.random.default_rng(2)
    time_s, signal = np.sort(rng.random(40)), rng.standard_normal((40, 3))
    trial = np.array([21.0, 55.5])
    for hz, found in zip(trial, _residual(time_s, signal, trial, 3), strict=True):
        phase = 2 * np.pi * hz * time_s[:, None] * [1, 2, 3]
        design = np.hstack([np.ones((40, 1)), np.cos(phase), np.sin(phase)])
        assert _design(time_s, np.array([hz]), 3)[0] == pytest.approx(design)
        wanted = np.linalg.lstsq(design, signal, rcond=None)[1].sum()
        assert found == pytest.approx(wanted, rel=1e-6)
    assert _parameters(3) == 3 * 7 + 1


def test_spreads_are_relative_variances_of_repeats_in_all_channels() -> None:
    exposures = np.repeat([10.0, 20.0], 4)
    light = np.array([1.0, 1.1, 0.9, 1.0, 1.02, 0.98, 1.0, 1.0])[:, None] * [1.0, 2.0, 3.0]
    found, spreads, counts = _spreads(table(exposures, BLACK_DN + exposures[:, None] * light), BLACK_DN)
    assert found.tolist() == [10.0, 20.0]
    assert counts.tolist() == [4, 4]
    assert spreads == pytest.approx([0.02 / 3, 0.0008 / 3], abs=2e-7)


def test_the_cost_of_spreads_is_the_likelihood_of_sample_variances() -> None:
    spreads, counts = np.array([0.03, 0.04]), np.array([4, 9])

    def likelihood(model: np.ndarray) -> float:
        # (n - 1) s / m has a chi-square distribution of n - 1 degrees of freedom.
        factor = (counts - 1) / model
        return float((chi2.logpdf(factor * spreads, counts - 1) + np.log(factor)).sum())

    one, other = np.array([0.02, 0.05]), np.array([0.04, 0.03])
    found = _cost_of(one, spreads, counts) - _cost_of(other, spreads, counts)
    assert found == pytest.approx((likelihood(other) - likelihood(one)) / (3 / 2 + 8 / 2))


def test_a_step_of_the_search_moves_the_longest_exposure_by_a_sixteenth_of_a_cycle() -> None:
    assert _step(np.array([10.0, 200.0])) == pytest.approx(1 / 16 / (300 * 0.2))


def test_a_beat_is_the_scatter_of_repeats_with_its_deviation_and_floor() -> None:
    light = np.array([[100.0, 200.0, 50.0], [104.0, 200.0, 50.0], [96.0, 200.0, 53.0]])
    exposures = np.array([30.0, 10.0, 30.0, 30.0])
    readings = table(exposures, BLACK_DN + np.vstack([light[:1], light[:1], light[1:]]))
    transfer = Transfer(Measured(value=10.0, std=0.1), Measured(value=2.0, std=0.1))
    sizes = RegionSizes(np.array([100, 400, 100]), np.zeros(3, np.int64), 12)
    repeated = readings[np.array([0, 1, 1, 2, 3])]
    first, second = check_beats(repeated, BLACK_DN, transfer, sizes)
    assert (first.exposure_ms, second.exposure_ms) == (30.0, 10.0)
    assert [each.value for each in first.channels_percent] == pytest.approx([4.0, 0.0, 100 * 3**0.5 / 51])
    assert [each.std for each in first.channels_percent] == pytest.approx([2.0, 0.0, 50 * 3**0.5 / 51])
    ratio = light[:, 2] / light[:, 1]
    wanted = max(100 * ratio.std(ddof=1) / ratio.mean(), 4.0)
    assert first.ratio_percent.value == pytest.approx(wanted)
    assert first.ratio_percent.std == pytest.approx(wanted / 2)
    floor = [100 * np.sqrt((4 + 1 / 12 + s / 10) / n) / s for s, n in ((100, 100), (200, 400), (51, 100))]
    assert first.floor_percent == pytest.approx(max(floor))


@pytest.mark.parametrize(("steps", "trusted"), [(3, True), (2, False)])
def test_three_steps_of_time_are_needed(steps: int, trusted: bool) -> None:
    gaps = np.array([5.0, 20.0, 35.0, 12.0])[: steps + 1]
    readings = table(np.ones(steps + 1), np.ones((steps + 1, 3)), np.cumsum(gaps) / 1000, gaps)
    assert has_trusted_times(readings) == trusted


def test_the_depth_of_a_cycle_is_half_the_height_of_the_strongest_channels_wave() -> None:
    readings = short_exposures(60.0)
    phase = 2 * np.pi * 60 * readings.timestamp_s
    light = 1 + np.sin(phase)[:, None] * [0.1, 0.3, 0.2]
    noise = 1e-4 * np.random.default_rng(1).standard_normal((96, 3))
    found = find_cycle(replace(readings, mean_dn=BLACK_DN + 300 * (light + noise)), BLACK_DN)
    assert found.modulation.value == pytest.approx(0.3, rel=0.02)
    assert found.period_ms is not None


def test_frequencies_are_tried_so_closely_that_the_third_harmonic_keeps_its_phase() -> None:
    inner = np.random.default_rng(5).uniform(-1.0, 1.5, 58)
    time_s = np.sort(np.append(inner, [-1.0, 1.5]))
    signal = np.sin(2 * np.pi * 61.0 * time_s[:, None] + np.arange(3))
    hz, step = _coarse(time_s, signal, float((signal**2).sum()))
    assert step == pytest.approx(1 / (4 * 3 * 2.5))
    assert hz == pytest.approx(61.0, abs=step)
    assert _coarse(time_s / 100, signal, 60.0)[1] == pytest.approx(1 / (12 * 0.1)), (
        "a tenth of a second at least"
    )


@pytest.mark.parametrize(("frames", "waves", "found"), [(96, 2, 2), (96, 5, 5), (30, 5, 4), (6, 1, 1)])
def test_harmonics_are_those_that_the_light_justifies(frames: int, waves: int, found: int) -> None:
    """One for every seven frames at most."""
    rng = np.random.default_rng(4)
    time_s = np.sort(rng.uniform(0, 3, frames))
    phase = 2 * np.pi * 47.0 * time_s[:, None]
    signal = sum(np.sin(k * phase + k * np.arange(3)) / k for k in range(1, waves + 1))
    signal = signal + 1e-3 * rng.standard_normal((frames, 3))
    assert _worthwhile(time_s, signal, 47.0) == found


def test_the_deviation_of_a_cycle_is_that_of_eight_fits_without_a_part_each() -> None:
    readings = short_exposures(60.0, jitter_ms=0.5)
    signal = readings.mean_dn / readings.mean_dn.mean(0) - 1
    time_s = readings.timestamp_s - readings.timestamp_s.mean()
    step = 1 / (12 * np.ptp(time_s))
    best, std_hz, amplitude = _fine(time_s, signal, 60.0, step)
    harmonics = _worthwhile(time_s, signal, _nearest(time_s, signal, 60.0, step, 3)[0])
    assert best == _nearest(time_s, signal, 60.0, step, harmonics)[0]
    fits = []
    for part in range(8):
        kept = np.delete(np.arange(96), np.s_[part::8])
        fits.append(_nearest(time_s[kept], signal[kept], best, step / 2, harmonics))
    spread = np.sqrt(7 * np.var(fits, axis=0))
    assert std_hz >= spread[0]
    assert std_hz < 2 * spread[0]
    assert amplitude.std == pytest.approx(spread[1])


def test_spreads_of_any_harmonic_are_explained_without_rest() -> None:
    exposures, counts = np.linspace(3.0, 60.0, 30), np.full(30, 8)
    for order in (1, 2, 8):
        spreads = 0.2 * np.sinc(exposures / 1000 * 50.0 * order) ** 2 + 1e-7
        perfect = _cost_of(spreads, spreads, counts)
        assert _cost(50.0, exposures, spreads, counts) == pytest.approx(perfect, abs=0.02)
        assert _cost(53.0, exposures, spreads, counts) > perfect + 0.1
