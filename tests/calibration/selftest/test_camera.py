"""Black level, noise, hot pixels and the line of exposures from readings with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.selftest.camera import (
    Dark,
    ExposureLine,
    Transfer,
    _saturation,
    black_change,
    check_camera,
    count_hot_pixels,
    exposure_line,
    fit_dark,
    fit_transfer,
    noise_of_frames,
    noise_of_pixels,
)
from dsl_core.calibration.selftest.readings import Readings, RegionSizes
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.selftest import Measured
from tests.cases.cycle_readings import table

BLACK_DN = 260.0


def test_hot_pixels_are_those_that_stand_out_twice() -> None:
    rng = np.random.default_rng(2)
    first, second = (np.rint(260 + rng.standard_normal((60, 80))).astype(np.uint16) for _ in range(2))
    # The faint light of a dark projector ends at a column; its edge is not hot.
    first[:, 30:] += 40
    second[:, 30:] += 40
    assert count_hot_pixels(first, second, 1.0) == 0
    first[0, 5] = second[0, 5] = first[20, 41] = second[20, 41] = 900
    first[40, 40] = 900
    assert count_hot_pixels(first, second, 1.0) == 2


def test_exposures_that_clip_bend_no_line() -> None:
    exposure = np.arange(1.0, 13.0)
    signal = 300 * exposure[:, None] * np.ones(3)
    # One pixel in a hundred clips in the last two frames, which pulls their means down.
    clipped = np.where(signal > 3200, 0.01, 0.0)
    series = replace(table(exposure, BLACK_DN + signal - 8e3 * clipped), clipped=clipped)
    sizes = RegionSizes(np.full(3, 5000), np.zeros(3, np.int64), 12)
    none = np.zeros(3)
    dark = Dark(Measured(value=BLACK_DN, std=0.01), none, none, none, none)
    transfer = Transfer(Measured(value=10.0, std=0.01), Measured(value=1.0, std=0.01))
    end = replace(series[-1:], mean_dn=np.full((1, 3), 4000.0), clipped=np.ones((1, 3)))
    found = check_camera(dark, transfer, series, end, (0, 100), sizes)
    assert max(each.value for each in found.linearity_percent) < 1e-6
    assert (found.useful_dn, found.saturation_dn.value) == (BLACK_DN + 3000, 4000.0)
    with pytest.raises(CalibrationError, match="red channel clips at all but 4 exposures"):
        check_camera(dark, transfer, series[np.array([0, 1, 2, 3, 10, 11])], end, (0, 100), sizes)


@pytest.mark.parametrize(("bend", "useful_share"), [(0.0, 0.98), (2.0, 0.92)])
def test_a_sensor_that_bends_before_it_saturates_counts_as_saturated_there(
    bend: float, useful_share: float
) -> None:
    share = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.92, 0.95, 0.98])
    full = 4095 - BLACK_DN
    bent = share - bend * np.clip(share - 0.9, 0, None) ** 2
    series = table(100 * share, BLACK_DN + full * bent[:, None] * np.ones(3))
    none = np.zeros(3)
    dark = Dark(Measured(value=BLACK_DN, std=0.01), none, none, none, none)
    transfer = Transfer(Measured(value=10.0, std=0.01), Measured(value=1.0, std=0.01))
    found = check_camera(dark, transfer, series, series[-1:], (0, 100), SIZES)
    assert found.bends is (bend > 0)
    assert found.useful_dn == pytest.approx(BLACK_DN + full * useful_share, abs=4)
    assert max(each.value for each in found.linearity_percent) < 0.1


def dark_readings(level_dn: tuple[float, float, float], rate: float, beside: float) -> Readings:
    """Eight pairs at 1 ms and 101 ms; read noise of 2 DN."""
    exposure = np.repeat([1.0, 101.0], 8)
    readings = table(exposure, np.array(level_dn) + rate * exposure[:, None] * np.ones(3))
    return replace(
        readings,
        beside_dn=np.array(level_dn) + beside * exposure[:, None],
        pair_variance_dn2=np.full((16, 3), 4.0),
        is_pair=np.arange(16) % 2 == 1,
    )


SIZES = RegionSizes(np.array([1000, 2000, 1000]), np.array([500, 1000, 500]), 12)


def test_the_black_level_is_that_of_no_exposure() -> None:
    found = fit_dark(dark_readings((BLACK_DN,) * 3, 0.3, 0.1), SIZES)
    assert found.level_dn.value == pytest.approx(BLACK_DN)
    assert found.rate == pytest.approx([0.3] * 3)
    assert found.beside_rate == pytest.approx([0.1] * 3)
    # Noise of 2 DN over 4000 pixels and eight frames; of a rate, over eight frames at either end of 100 ms.
    assert found.level_dn.std == pytest.approx(2 / np.sqrt(4000 * 8))
    assert found.rate_std[1] == pytest.approx(2 * np.sqrt(2 / 8 / 2000) / 100)
    assert found.beside_std[0] == pytest.approx(2 * np.sqrt(2 / 8 / 500) / 100)


def test_channels_that_differ_leave_the_black_level_uncertain() -> None:
    found = fit_dark(dark_readings((BLACK_DN - 1, BLACK_DN, BLACK_DN + 1), 0.0, 0.0), SIZES)
    assert found.level_dn.value == pytest.approx(BLACK_DN)
    assert found.level_dn.std == pytest.approx(0.5, abs=0.01)


def pairs(electrons_per_dn: float, read_noise_dn: float) -> Readings:
    """Variances of pairs at twelve signals, with the scatter that so many pixels give."""
    rng = np.random.default_rng(0)
    signal = np.linspace(0, 3000, 12)[:, None] * np.ones(3)
    variance = read_noise_dn**2 + 1 / 12 + signal / electrons_per_dn
    variance = variance * (1 + np.sqrt(2 / SIZES.pixels) * rng.standard_normal(variance.shape))
    readings = table(np.ones(12), BLACK_DN + signal)
    return replace(readings, pair_variance_dn2=variance, is_pair=np.ones(12, bool))


def test_gain_and_read_noise_are_the_line_of_photon_transfer() -> None:
    found = fit_transfer(pairs(10.0, 2.0), BLACK_DN, SIZES)
    assert found.electrons_per_dn.value == pytest.approx(10.0, abs=4 * found.electrons_per_dn.std)
    assert found.electrons_per_dn.std < 0.2
    assert found.read_noise_dn.value == pytest.approx(2.0, abs=4 * found.read_noise_dn.std)
    assert found.read_noise_dn.std < 0.05
    mean_std = found.mean_std(np.array([1000.0]), np.array([400]))
    assert mean_std == pytest.approx(np.sqrt((4 + 1 / 12 + 100) / 400), rel=0.03)


def test_frames_that_are_no_pairs_or_clip_do_not_count() -> None:
    readings = pairs(10.0, 2.0)
    wrong = readings.pair_variance_dn2.copy()
    wrong[3], wrong[5, 1] = 0.0, 1e4
    clipped = readings.clipped.copy()
    clipped[5, 1] = 0.01
    spoilt = replace(readings, pair_variance_dn2=wrong, clipped=clipped, is_pair=np.arange(12) != 3)
    found = fit_transfer(spoilt, BLACK_DN, SIZES)
    assert found.electrons_per_dn.value == pytest.approx(10.0, abs=0.5)


def test_noise_that_does_not_grow_with_light_is_refused() -> None:
    readings = replace(pairs(10.0, 2.0), pair_variance_dn2=np.full((12, 3), 4.0))
    with pytest.raises(CalibrationError, match="not raw photon counts"):
        fit_transfer(readings, BLACK_DN, SIZES)


@pytest.mark.parametrize(
    ("excess_dn", "noise_dn", "hot"), [(5, 0.5, 0), (6, 0.5, 1), (12, 2.0, 0), (13, 2.0, 1)]
)
def test_a_hot_pixel_stands_out_by_six_deviations_and_five_counts(
    excess_dn: int, noise_dn: float, hot: int
) -> None:
    frame = np.full((20, 20), 260, np.uint16)
    # A neighbour of the same colour glows by a count.
    frame[6, 10] = 261
    frame[8, 10] = 261 + excess_dn
    assert count_hot_pixels(frame, frame, noise_dn) == hot
    assert count_hot_pixels(frame, np.full((20, 20), 260, np.uint16), noise_dn) == 0
    # Pixels of another colour do not count as neighbours.
    frame[8, 11] = 4000
    assert count_hot_pixels(frame, frame, noise_dn) == hot + 1


@pytest.mark.parametrize(("exposures", "enough"), [(5, True), (4, False)])
def test_a_line_needs_five_exposures(exposures: int, enough: bool) -> None:
    exposure = np.repeat(np.arange(1.0, exposures + 1), 2)
    series = table(exposure, BLACK_DN + 100 * exposure[:, None] * np.ones(3))
    level = Dark(Measured(value=BLACK_DN, std=0.1), *[np.zeros(3)] * 4)
    transfer = Transfer(Measured(value=10.0, std=0.1), Measured(value=2.0, std=0.1))
    if not enough:
        with pytest.raises(CalibrationError, match="green channel clips at all but 4"):
            exposure_line(series, 1, level, transfer, SIZES)
        return
    line = exposure_line(series, 1, level, transfer, SIZES)
    assert line.intercept.value == pytest.approx(BLACK_DN)
    # Shot, read and rounding noise over the region, and light that is steady to one part in ten thousand.
    shot = np.sqrt((4 + 1 / 12 + 100 * exposure / 10) / SIZES.pixels[1])
    assert line.std_dn == pytest.approx(np.hypot(shot, 0.01 * exposure))


def test_the_largest_distance_from_a_line_is_stated_in_percent_of_full_scale() -> None:
    line = ExposureLine(
        np.arange(3.0),
        np.zeros(3),
        np.array([1.0, -4.0, 2.0]),
        np.array([0.1, 0.2, 0.3]),
        Measured(value=0, std=1),
    )
    found = line.largest_percent(1000.0)
    assert found.value == pytest.approx(0.4)
    assert found.std == pytest.approx(0.02)


def test_the_scale_ends_where_regions_clip_or_beyond_the_largest_signal() -> None:
    readings = table(np.arange(2.0), np.array([[4090.0, 4000.0, 3000.0], [4094.0, 4095.0, 2000.0]]))
    readings.clipped[:] = [[0.99, 0.97, 0.0], [1.0, 1.0, 0.0]]
    found = _saturation(readings)
    assert found.value == pytest.approx((4090 + 4094 + 4095) / 3)
    assert found.std == pytest.approx(np.std([4090, 4094, 4095]))
    readings.clipped[:] = 0.0
    assert _saturation(readings).value == 4095.0


@pytest.mark.parametrize("read_dn", [0.5, 3.0])
def test_read_noise_is_what_rounding_leaves_of_the_variance_without_light(read_dn: float) -> None:
    signal = np.array([0.0, 500.0, 1000.0, 2000.0, 3000.0])
    readings = replace(
        table(np.full(5, 10.0), BLACK_DN + signal[:, None] * np.ones(3)),
        pair_variance_dn2=(read_dn**2 + 1 / 12 + signal / 8)[:, None] * np.ones(3),
        is_pair=np.ones(5, bool),
    )
    found = fit_transfer(readings, BLACK_DN, RegionSizes(np.full(3, 5000), np.zeros(3, np.int64), 12))
    assert found.electrons_per_dn.value == pytest.approx(8.0)
    assert found.read_noise_dn.value == pytest.approx(read_dn)
    model = np.repeat(read_dn**2 + 1 / 12 + signal / 8, 3)
    rows = np.stack([np.ones(15), np.repeat(signal, 3)], 1) / (model * np.sqrt(2 / 5000))[:, None]
    covariance = np.linalg.inv(rows.T @ rows)
    assert found.read_noise_dn.std == pytest.approx(np.sqrt(covariance[0, 0]) / (2 * read_dn))
    assert found.electrons_per_dn.std == pytest.approx(np.sqrt(covariance[1, 1]) * 64)


def test_intercepts_are_weighted_by_their_deviations_and_hot_pixels_are_a_share() -> None:
    exposure = np.arange(1.0, 9.0)
    signal = exposure[:, None] * [400.0, 100.0, 10.0] + [1.0, 2.0, 3.0]
    series = table(exposure, BLACK_DN + signal)
    sizes = RegionSizes(np.array([4000, 2000, 100]), np.zeros(3, np.int64), 12)
    none = np.zeros(3)
    dark = Dark(Measured(value=BLACK_DN, std=0.01), none, none, none, none)
    transfer = Transfer(Measured(value=10.0, std=0.01), Measured(value=1.0, std=0.01))
    end = replace(series[-1:], mean_dn=np.full((1, 3), 4000.0), clipped=np.ones((1, 3)))
    found = check_camera(dark, transfer, series, end, (3, 1000), sizes)
    lines = [exposure_line(series, channel, dark, transfer, sizes).intercept for channel in range(3)]
    weight = np.array([line.std**-2 for line in lines])
    values = np.array([line.value for line in lines])
    assert len(set(weight.round(6))) == 3
    assert found.intercept_dn.value == pytest.approx(weight @ values / weight.sum())
    assert found.intercept_dn.std == pytest.approx(weight.sum() ** -0.5)
    assert (found.hot_share.value, found.hot_share.std) == pytest.approx((3e-3, 3**0.5 * 1e-3))


def test_glow_is_taken_off_the_shortest_exposure() -> None:
    exposure = np.repeat([4.0, 104.0], 8)
    readings = replace(
        table(exposure, 200 + exposure[:, None] * [0.5, 0.25, 0.125]),
        beside_dn=200 + exposure[:, None] * np.full(3, 0.0625),
        pair_variance_dn2=np.full((16, 3), 4.0),
        is_pair=np.arange(16) % 2 == 1,
    )
    sizes = RegionSizes(np.array([400, 800, 400]), np.array([100, 0, 100]), 12)
    found = fit_dark(readings, sizes)
    assert found.level_dn.value == pytest.approx(200.0)
    assert found.rate == pytest.approx(np.array([0.5, 0.25, 0.125]))
    assert found.beside_rate == pytest.approx(np.full(3, 0.0625))
    assert found.rate_std == pytest.approx(2 * np.sqrt(0.25 / sizes.pixels) / 100)
    assert found.beside_std == pytest.approx(2 * np.sqrt(0.25 / np.array([100, 1, 100])) / 100)


def pairs_of(variance_dn2: list[float], covariance_dn2: list[float], second_dn2: list[float]) -> Readings:
    """Dark pairs whose three colours have the same noise."""
    pairs = dark_readings((BLACK_DN,) * 3, 0.0, 0.0)[np.flatnonzero(np.arange(16) % 2)[: len(variance_dn2)]]
    columns = (
        np.repeat(np.array(each)[:, None], 3, 1) for each in (variance_dn2, covariance_dn2, second_dn2)
    )
    variance, covariance, second = columns
    return replace(
        pairs, pair_variance_dn2=variance, pair_covariance_dn2=covariance, second_variance_dn2=second
    )


def test_noise_that_pixels_share_is_weighed_by_how_much_there_is() -> None:
    dark = pairs_of([2.0, 2.0], [0.0, 0.0], [0.0, 0.0])
    found = noise_of_pixels(dark, pairs_of([6.0, 38.0], [1.0, 9.0], [0.0, 0.0]), SIZES)
    assert found is not None
    assert found.value == pytest.approx(0.25)
    # Of 4000 pixels in three colours; the brighter pair says nearly all.
    assert found.std == pytest.approx(np.sqrt((6**2 + 38**2) * (2 / 1000 + 1 / 2000)) / 120)
    assert noise_of_pixels(dark, pairs_of([4.0], [0.0], [0.0]), SIZES) is None


def test_noise_of_rows_that_dark_frames_have_as_well_is_not_that_of_light() -> None:
    dark, lit = pairs_of([12.0], [10.0], [0.0]), pairs_of([22.0], [10.0], [0.0])
    found = noise_of_pixels(dark, lit, SIZES)
    assert found is not None
    assert found.value == pytest.approx(0.0)


def test_noise_that_frames_share_makes_those_further_apart_differ_by_more() -> None:
    found = noise_of_frames(pairs_of([4.0, 2.0, 2.0], [0.0] * 3, [0.0, 3.0, 3.0]), SIZES)
    assert found is not None
    assert found.value == pytest.approx(0.5)
    assert found.std == pytest.approx(1.5 * np.sqrt(4 / 8000))
    # Of noise below the step of rounding nobody knows.
    assert noise_of_frames(pairs_of([0.1, 0.1], [0.0] * 2, [0.1, 0.2]), SIZES) is None
    assert noise_of_frames(pairs_of([4.0], [0.0], [0.0]), SIZES) is None


def test_black_has_gained_what_its_light_does_not_explain() -> None:
    dark = fit_dark(dark_readings((BLACK_DN,) * 3, 0.3, 0.1), SIZES)
    transfer = Transfer(Measured(value=10.0, std=0.01), Measured(value=2.0, std=0.01))
    again = table(np.full(4, 1.0), np.full((4, 3), BLACK_DN + 0.3 + 5.0))
    found = black_change(dark, again, transfer, SIZES)
    assert found.value == pytest.approx(5.0)
    assert found.std == pytest.approx(np.hypot(dark.level_dn.std, np.sqrt((4 + 1 / 12) / 16000)))


def test_exposures_that_are_longer_than_stated_are_measured() -> None:
    exposure = np.arange(1.0, 13.0)
    series = table(exposure, BLACK_DN + np.array([100.0, 300.0, 200.0]) * (exposure[:, None] + 0.4))
    sizes = RegionSizes(np.full(3, 5000), np.zeros(3, np.int64), 12)
    none = np.zeros(3)
    dark = Dark(Measured(value=BLACK_DN, std=0.01), none, none, none, none)
    transfer = Transfer(Measured(value=10.0, std=0.01), Measured(value=1.0, std=0.01))
    found = check_camera(dark, transfer, series, series[-1:], (0, 100), sizes).exposure_offset_ms
    assert found is not None
    assert found.value == pytest.approx(0.4)
    assert 0 < found.std < 0.01
