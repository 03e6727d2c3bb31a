"""The form of light by drive level from ramps with known truth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.calibration.selftest.tone import RampLight, design_of, fit_tone, mean_exponent
from dsl_core.campaign.selftest.parts import RAMP_LEVELS
from dsl_core.model.calibration.selftest import Colour

Floats = NDArray[np.float64]
LEVELS = np.sort(np.array(RAMP_LEVELS)) / 255
COLOURS: tuple[Colour, ...] = ("white", "red", "green", "blue")


def srgb(level: Floats) -> Floats:
    return np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)


def s_curve(level: Floats) -> Floats:
    return np.asarray(level**2 / (level**2 + 0.4 * (1 - level) ** 1.6))


def toe(level: Floats) -> Floats:
    return np.asarray(((level - 0.03) / 0.97) ** 2)


def ramp(colour: Colour, light: Floats, noise: float = 2e-4, seed: int = 0) -> RampLight:
    """Three channels that see the light of all levels at different scales."""
    rng = np.random.default_rng((seed, COLOURS.index(colour)))
    value = np.log(light) + np.log([[90.0], [200.0], [40.0]]) + noise * rng.standard_normal((3, len(light)))
    channel = np.repeat(np.arange(3), len(light))
    return RampLight(
        colour, channel, np.tile(LEVELS, 3), value.ravel(), np.full(3 * len(light), max(noise, 1e-4)), 0
    )


@pytest.mark.parametrize("curve", [srgb, s_curve, toe])
def test_curves_that_are_no_power_law_are_found(curve: Callable[[Floats], Floats]) -> None:
    found = fit_tone([ramp(colour, curve(LEVELS)) for colour in COLOURS])
    assert found is not None
    between = np.linspace(LEVELS[0], 1.0, 60)
    off = found.light(between) / curve(between) - 1
    assert np.abs(off).max() < 0.005
    assert np.sqrt((off**2).mean()) < 2 * found.rel_std
    assert found.lowest_level == LEVELS[0]


@pytest.mark.parametrize("noise", [1e-4, 1e-2])
def test_a_power_law_stays_one_however_noisy(noise: float) -> None:
    for seed in range(20):
        assert fit_tone([ramp(colour, LEVELS**2.2, noise, seed) for colour in COLOURS]) is None


def test_the_deviation_holds_what_colours_differ_by() -> None:
    arch = 4 * LEVELS * (1 - LEVELS)
    lights = [srgb(LEVELS) * (1 + share * arch) for share in (0.0, 0.02, 0.0, -0.02)]
    found = fit_tone([ramp(colour, light) for colour, light in zip(COLOURS, lights, strict=True)])
    assert found is not None
    assert 0.003 < found.rel_std < 0.02
    assert found.light(LEVELS) == pytest.approx(srgb(LEVELS), rel=0.01)


def test_colours_have_scales_of_their_own_and_one_form() -> None:
    ramps = [ramp("white", LEVELS**2.0), ramp("red", LEVELS**2.0)]
    design, present = design_of(ramps, 2)
    assert present == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]
    assert design[:, :6].sum(1).tolist() == [1.0] * len(design)
    assert design[:, 6] == pytest.approx(np.log(np.tile(LEVELS, 6)))
    assert design[:, 7] == pytest.approx(design[:, 6] ** 2)


def test_the_mean_exponent_is_that_between_the_levels_of_a_scan() -> None:
    assert mean_exponent(1).tolist() == [1.0]
    coefficients = np.array([2.0, 0.3, -0.1])
    low, high = (float(sum(c * np.log(x) ** (k + 1) for k, c in enumerate(coefficients))) for x in (0.2, 0.8))
    assert float(mean_exponent(3) @ coefficients) == pytest.approx((high - low) / np.log(4))
