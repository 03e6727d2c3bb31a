"""Gamma, black and ambient light of a projector from ramps with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.selftest.camera import Dark, Transfer
from dsl_core.calibration.selftest.projector import RAMPS, check_projector, ramp_of
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
