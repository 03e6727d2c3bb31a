"""Gamma, black and ambient light of a projector from ramps with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.selftest.camera import Dark, Transfer
from dsl_core.calibration.selftest.projector import (
    RAMPS,
    _ambient,
    _black_fraction,
    _falls,
    _fit_ramp,
    check_projector,
    ramp_light,
    ramp_of,
)
from dsl_core.calibration.selftest.readings import Readings, RegionSizes
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.selftest import Measured
from tests.cases.cycle_readings import MIX, table

BLACK_DN, AMBIENT, BLACK = 260.0, 0.05, 0.001
GAMMA = {"white": 2.2, "red": 2.2, "green": 2.2, "blue": 2.2}
SIZES = RegionSizes(np.full(3, 5000), np.full(3, 2000), 12)
TRANSFER = Transfer(Measured(value=10.0, std=0.01), Measured(value=1.0, std=0.01))
LEVELS = np.arange(40, 256, 24)


def ramps(gamma: dict[str, float] = GAMMA, noise: float = 1e-4) -> Readings:
    """Nine levels of each colour, exposed so that none clips; black and ambient light come on top."""
    rng, rows = np.random.default_rng(0), []
    for colour, leds in RAMPS.items():
        for level in LEVELS:
            light = (np.array(leds) * (level / 255) ** gamma[colour] * (1 - BLACK) + BLACK) @ MIX + AMBIENT
            exposure = 2000 / light.max()
            signal = light * exposure * (1 + noise * rng.standard_normal(3))
            rows.append((exposure, BLACK_DN + signal, level * np.array(leds)))
    exposure, mean, drive = (np.array(column) for column in zip(*rows, strict=True))
    return replace(table(exposure, mean), drive=drive)


def dark(beside: bool = True) -> Dark:
    rate = BLACK * MIX.sum(0) + AMBIENT
    return Dark(
        Measured(value=BLACK_DN, std=0.005), rate, np.full(3, 1e-4), np.full(3, AMBIENT), np.full(3, 1e-4)
    )


def test_gamma_and_black_are_found_within_their_deviations() -> None:
    found, ambient = check_projector(ramps(), dark(), TRANSFER, SIZES)
    for each in (found.gamma, *(ramp.gamma for ramp in found.ramps)):
        assert each.value == pytest.approx(2.2, abs=2e-3)
        assert abs(each.value - 2.2) < 4 * each.std
    assert [ramp.colour for ramp in found.ramps] == ["white", "red", "green", "blue"]
    assert found.black_fraction.value == pytest.approx(BLACK, abs=4 * found.black_fraction.std)
    assert found.black_fraction.std < 0.05 * BLACK
    assert not found.black_has_ambient
    assert sum(ramp.falls for ramp in found.ramps) == 0
    # The channel with the least white light has the largest share of what is left with the projector black.
    share = (dark().rate / MIX.sum(0)).max()
    assert ambient.share_of_white.value == pytest.approx(share, rel=2e-3)
    assert ambient.rate_dn_per_ms[1].value == pytest.approx(dark().rate[1])


def test_a_colour_of_its_own_gamma_is_told() -> None:
    found, _ = check_projector(ramps({**GAMMA, "blue": 2.3}), dark(), TRANSFER, SIZES)
    gammas = {ramp.colour: ramp.gamma.value for ramp in found.ramps}
    assert gammas["blue"] == pytest.approx(2.3, abs=3e-3)
    assert gammas["red"] == pytest.approx(2.2, abs=3e-3)


def test_without_pixels_beside_the_picture_black_may_be_ambient_light() -> None:
    nothing = RegionSizes(SIZES.pixels, np.zeros(3, np.int64), 12)
    found, _ = check_projector(ramps(), dark(), TRANSFER, nothing)
    assert found.black_has_ambient
    assert found.black_fraction.value > BLACK
    assert found.black_fraction.std >= found.black_fraction.value / np.sqrt(3)


def test_a_step_that_falls_and_a_ramp_off_the_power_law_are_counted() -> None:
    readings = ramps()
    mean = readings.mean_dn.copy()
    white = np.flatnonzero((readings.drive > 0).all(1))
    # Dynamic contrast: the sixth step is darker than the fifth.
    mean[white[5]] = BLACK_DN + 0.5 * (mean[white[5]] - BLACK_DN)
    found, _ = check_projector(replace(readings, mean_dn=mean), dark(), TRANSFER, SIZES)
    by_name = {ramp.colour: ramp for ramp in found.ramps}
    assert (by_name["white"].falls, by_name["red"].falls) == (1, 0)
    assert by_name["white"].residual_percent.value > 5
    assert by_name["red"].residual_percent.value < 0.1


def test_a_ramp_is_the_frames_of_exactly_its_leds_and_a_dark_one_is_refused() -> None:
    readings = ramps()
    assert [len(ramp_of(readings, colour)) for colour in RAMPS] == [9] * 4
    lost = replace(readings, clipped=np.where((readings.drive[:, [0]] > 0), 1.0, readings.clipped))
    with pytest.raises(CalibrationError, match="white ramp of the projector gives too little"):
        check_projector(lost, dark(), TRANSFER, SIZES)


def test_the_distance_from_the_power_law_is_stated_in_percent_with_its_deviation() -> None:
    found, _ = check_projector(ramps(noise=0.02), dark(), TRANSFER, SIZES)
    for ramp in found.ramps:
        # Noise of two percent at nine levels in three channels.
        assert 1.0 < ramp.residual_percent.value < 3.0
        assert 0.05 < ramp.residual_percent.std / ramp.residual_percent.value < 0.25


def test_gamma_scatters_by_what_is_stated() -> None:
    """Fifty ramps whose noise is that of steady light: three parts in ten thousand and a little more."""
    rng = np.random.default_rng(7)
    clean = ramps(noise=0.0)
    seen, stated = [], []
    for _ in range(50):
        signal = (clean.mean_dn - BLACK_DN) * (1 + 5e-3 * rng.standard_normal(clean.mean_dn.shape))
        found, _ = check_projector(replace(clean, mean_dn=BLACK_DN + signal), dark(), TRANSFER, SIZES)
        seen.append(found.gamma.value)
        stated.append(found.gamma.std)
    assert np.std(seen) == pytest.approx(np.mean(stated), rel=0.35)
    assert np.mean(seen) == pytest.approx(2.2, abs=3 * float(np.mean(stated)))


def test_the_distance_from_the_power_law_has_the_deviation_of_so_many_values() -> None:
    found, _ = check_projector(ramps(noise=0.02), dark(), TRANSFER, SIZES)
    for ramp in found.ramps:
        values = ramp.residual_percent.std**-2 * ramp.residual_percent.value**2 / 2
        # Nine levels in three channels, of which some channels see too little of a colour.
        assert values == pytest.approx(round(values), abs=1e-6)
        assert 9 <= round(values) <= 27


@pytest.mark.parametrize(("drop", "falls"), [(4.9, 0), (5.1, 1)])
def test_a_step_falls_by_five_deviations_of_both_levels(drop: float, falls: int) -> None:
    drive, rate, std = np.array([0.2, 0.6, 0.4]), np.ones((3, 3)), np.full((3, 3), 0.3)
    rate[1, 0] -= drop * 0.3 * np.sqrt(2)
    used = np.ones((3, 3), bool)
    # In order of drive: from 0.4 to 0.6 it falls, in one channel.
    assert _falls(drive, rate, std, used) == falls
    used[1, 0] = False
    assert _falls(drive, rate, std, used) == 0


def test_the_black_of_a_projector_is_a_share_of_white_and_doubtful_under_ambient_light() -> None:
    white, white_std = np.array([10.0, 20.0, 0.0]), np.array([0.1, 0.1, 0.1])
    rate = np.array([0.3, 0.5, 9.0])
    level = Measured(value=BLACK_DN, std=0.01)
    lit = Dark(level, rate, np.full(3, 0.01), np.array([0.1, 0.1, 0.1]), np.full(3, 0.01))
    found, has_ambient = _black_fraction(lit, white, white_std, SIZES)
    share = np.array([0.2 / 10.2, 0.4 / 20.4])
    each = np.array(
        [np.hypot(np.sqrt(2) * 0.01, 0.2 * 0.01) / 10, np.hypot(np.sqrt(2) * 0.01, 0.4 * 0.005) / 20]
    )
    weight = each**-2 / (each**-2).sum()
    assert not has_ambient
    assert found.value == pytest.approx(weight @ share)
    assert found.std == pytest.approx((each**-2).sum() ** -0.5, rel=1e-6)
    nothing = RegionSizes(SIZES.pixels, np.array([5, 0, 5]), 12)
    doubtful, has_ambient = _black_fraction(lit, white, white_std, nothing)
    assert has_ambient
    each = np.array([np.hypot(0.01, 0.3 * 0.01) / 10, np.hypot(0.01, 0.5 * 0.005) / 20])
    weight = each**-2 / (each**-2).sum()
    value = weight @ np.array([0.3 / 10.3, 0.5 / 20.5])
    assert doubtful.value == pytest.approx(value)
    scatter = max(1.0, float((((np.array([0.3 / 10.3, 0.5 / 20.5]) - value) / each) ** 2).sum()))
    assert doubtful.std == pytest.approx(np.hypot(np.sqrt(scatter / (each**-2).sum()), value / np.sqrt(3)))


@pytest.mark.parametrize(("levels", "enough"), [(4, True), (3, False)])
def test_a_ramp_needs_four_levels_that_are_neither_dark_nor_clipped(levels: int, enough: bool) -> None:
    readings = ramps()
    clipped = np.array(readings.clipped)
    for rows in np.array_split(np.arange(len(readings)), 4):
        clipped[rows[levels:]] = 1.0
    part = replace(readings, clipped=clipped)
    if enough:
        assert check_projector(part, dark(), TRANSFER, SIZES)[0].gamma.value == pytest.approx(2.2, abs=0.01)
    else:
        with pytest.raises(CalibrationError, match="3 of 9 frames"):
            check_projector(part, dark(), TRANSFER, SIZES)


def test_white_and_ambient_light_of_a_colour_without_light_say_nothing() -> None:
    level = Measured(value=BLACK_DN, std=0.01)
    found = _ambient(
        Dark(level, np.array([0.1, 0.3, 9.0]), np.array([0.01, 0.02, 0.5]), np.zeros(3), np.zeros(3)),
        np.array([0.5, 0.6, 0.0]),
    )
    assert [rate.value for rate in found.rate_dn_per_ms] == [0.1, 0.3, 9.0]
    assert [rate.std for rate in found.rate_dn_per_ms] == [0.01, 0.02, 0.5]
    assert (found.share_of_white.value, found.share_of_white.std) == pytest.approx((0.5, 0.02 / 0.6))


def test_signals_below_thirty_deviations_are_left_out_of_the_fit() -> None:
    # Noise of 1 DN and of one in a thousand of the light: 25 and 40 deviations.
    quiet = Transfer(Measured(value=1e9, std=1.0), Measured(value=np.sqrt(1 - 1 / 12), std=0.0))
    sizes = RegionSizes(np.ones(3, np.int64), np.ones(3, np.int64), 12)
    none = np.zeros(3)
    dark_none = Dark(Measured(value=BLACK_DN, std=0.0), none, none, none, none)
    levels = np.array([40, 80, 120, 160, 200, 255])
    signal = 1000 * (levels / 255.0) ** 2
    for at, is_used in ((25.0, False), (40.0, True)):
        seen = signal.copy()
        seen[0] = at
        ramp = replace(
            table(np.full(6, 10.0), BLACK_DN + seen[:, None] * [1.0, 0.0, 0.0]),
            drive=levels[:, None] * np.array([1, 0, 0]),
        )
        check, full, _ = _fit_ramp(ramp_light(ramp, "red", dark_none, quiet, sizes), 1)
        assert (abs(check.gamma.value - 2.0) < 1e-6) != is_used
        assert (abs(full[0] - 100.0) < 1e-3) != is_used
        assert full[1:].tolist() == [0.0, 0.0]


def test_deviations_of_light_are_those_of_noise_black_and_glow_together() -> None:
    transfer = Transfer(Measured(value=10.0, std=0.0), Measured(value=2.0, std=0.0))
    exposure = np.array([4.0, 3.0, 2.0, 1.5, 1.2])
    levels = np.array([51, 102, 153, 204, 255])
    light = 600 * (levels / 255.0)[:, None] ** 2 * exposure[:, None] * [0.0, 1.0, 0.5]
    glow = Dark(Measured(value=BLACK_DN, std=0.7), np.full(3, 0.2), np.full(3, 0.3), np.zeros(3), np.zeros(3))
    ramp = replace(
        table(exposure, BLACK_DN + light + 0.2 * exposure[:, None]),
        drive=levels[:, None] * np.array([0, 1, 0]),
    )
    sizes = RegionSizes(np.full(3, 25), np.full(3, 25), 12)
    check, full, full_std = _fit_ramp(ramp_light(ramp, "green", glow, transfer, sizes), 1)
    signal = light[:, 1:]
    std = np.sqrt(
        (4 + 1 / 12 + signal / 10) / 25 + (1e-4 * signal) ** 2 + 0.7**2 + (0.3 * exposure[:, None]) ** 2
    )
    used = signal > 30 * std
    channel = np.nonzero(used)[1]
    level = np.log(np.broadcast_to(levels[:, None] / 255, used.shape)[used])
    design = (
        np.stack([channel == 0, channel == 1, level], 1) / (std / np.where(used, signal, 1))[used][:, None]
    )
    covariance = np.linalg.inv(design.T @ design)
    assert check.gamma.value == pytest.approx(2.0)
    assert check.gamma.std == pytest.approx(np.sqrt(covariance[2, 2]))
    assert full == pytest.approx([0.0, 600.0, 300.0])
    assert full_std[1:] == pytest.approx(full[1:] * np.sqrt(np.diag(covariance)[:2]))


def test_black_is_a_share_of_faint_white_too_and_less_than_all() -> None:
    level, none = Measured(value=BLACK_DN, std=0.01), np.zeros(3)
    faint = Dark(level, np.array([0.05, 0.08, 0.0]), np.full(3, 1e-3), none, np.full(3, 1e-3))
    found, _ = _black_fraction(faint, np.array([0.5, 0.8, 0.0]), np.full(3, 1e-3), SIZES)
    assert found.value == pytest.approx(1 / 11)
    bright = replace(faint, rate=np.full(3, 500.0))
    assert _black_fraction(bright, np.array([0.5, 0.8, 0.0]), np.full(3, 1e-3), SIZES)[0].value == 0.99


def test_leds_of_a_ramp_are_those_of_its_colour() -> None:
    assert RAMPS == {"white": (1, 1, 1), "red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1)}
