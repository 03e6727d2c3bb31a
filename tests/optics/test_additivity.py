"""Sums of patterns and inverses tell linear values from encoded ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.optics.additivity import (
    Additivity,
    MixedLight,
    StripeLight,
    additivity,
    mixed_light,
    stripe_light,
)
from dsl_core.optics.colour import srgb_decode, srgb_encode

Floats = NDArray[np.float64]
Encoding = Callable[[Floats], Floats]
FULL_DN = 4095


def linear(light: Floats) -> Floats:
    return light


def pair(
    encode: Encoding, period_px: int, lamp: float = 1.0, brightest: float = 0.8, noise: float = 0.004
) -> MixedLight | None:
    """A wall under stripes of a period, blurred by the lens; white was taken with another lamp."""
    width = 240
    stripes = (np.arange(width) // (period_px // 2) % 2).astype(float)
    share = np.convolve(np.pad(stripes, 4, "wrap"), np.ones(9) / 9, "valid")
    albedo = np.linspace(0.4, 1.0, 60)[:, None]
    rng = np.random.default_rng(period_px)

    def frame(light: Floats) -> NDArray[np.uint16]:
        values = encode((0.02 + brightest * light).clip(0, 1)) + rng.normal(0, noise, (60, width))
        return np.asarray(np.rint(values.clip(0, 1) * FULL_DN), np.uint16)

    one, other = frame(albedo * share), frame(albedo * (1 - share))
    white, black = frame(lamp * albedo * np.ones(width)), frame(np.zeros((60, width)))
    return mixed_light((one, other), white, black, FULL_DN)


def told(encode: Encoding, **how: float) -> Additivity:
    found = additivity(pair(encode, period, **how) for period in (24, 40, 60))
    assert found is not None
    return found


def test_linear_values_add_up_whatever_the_lamp_does() -> None:
    for lamp in (1.0, 1.06):
        found = told(linear, lamp=lamp)
        assert abs(found.excess) < 0.01 + 3 * found.excess_std
        assert found.exponent == pytest.approx(1.0, abs=0.05)
        assert found.is_linear
        assert not found.is_srgb


def test_pictures_for_screens_are_told_by_their_exponent() -> None:
    found = told(srgb_encode)
    assert found.excess > 0.1 + 3 * found.excess_std
    assert found.exponent == pytest.approx(2.2, abs=0.25)
    assert found.is_srgb
    assert not found.is_linear
    assert "brighter than" in found.figure
    other = told(lambda light: light ** (1 / 1.5))
    assert other.exponent == pytest.approx(1.5, abs=0.1)
    assert not other.is_linear
    assert not other.is_srgb


def test_linear_values_that_were_decoded_are_too_dark() -> None:
    found = told(srgb_decode)
    assert found.excess < -0.1
    assert not found.is_linear
    assert not found.is_srgb
    assert "darker than" in found.figure


def test_saturated_or_unlit_pixels_and_sharp_stripes_say_nothing() -> None:
    assert pair(linear, 24, brightest=3.0) is None
    assert pair(linear, 24, brightest=0.01) is None
    flat = np.full((30, 30), 100, np.uint16)
    white, black = np.full((30, 30), 3000, np.uint16), np.full((30, 30), 90, np.uint16)
    assert mixed_light((white, flat), white, black, FULL_DN) is None
    assert additivity([None]) is None


@pytest.mark.parametrize(("brightest", "noise"), [(0.8, 0.03), (0.8, 0.15), (0.3, 0.05), (0.15, 0.03)])
def test_noise_is_not_taken_for_an_encoding(brightest: float, noise: float) -> None:
    found = additivity(pair(linear, period, brightest=brightest, noise=noise) for period in (24, 40, 60))
    assert found is None or found.is_linear
    assert (found is None) == (noise * 10 > brightest)


@pytest.mark.parametrize(
    ("excess", "exponent", "is_linear", "is_srgb"),
    [
        (0.029, 2.2, True, False), (0.031, 2.2, False, True), (-0.2, 2.2, False, False),
        (0.2, 0.69, False, False), (0.2, 0.71, True, False), (0.2, 1.29, True, False),
        (0.2, 1.31, False, False), (0.2, 1.59, False, False), (0.2, 1.61, False, True),
        (0.2, 2.99, False, True), (0.2, 3.01, False, False), (0.2, float("nan"), False, False),
    ],
)  # fmt: skip
def test_verdicts_follow_from_excess_and_exponent(
    excess: float, exponent: float, is_linear: bool, is_srgb: bool
) -> None:
    found = Additivity(excess, 0.0, exponent, 0.0, 6, 900)
    assert (found.is_linear, found.is_srgb) == (is_linear, is_srgb)


def test_three_deviations_may_be_linear() -> None:
    assert Additivity(0.2, 0.0, 1.59, 0.1, 6, 900).is_linear
    assert not Additivity(0.2, 0.0, 1.61, 0.1, 6, 900).is_linear
    assert Additivity(0.2, 0.0, 0.41, 0.1, 6, 900).is_linear
    assert not Additivity(0.2, 0.0, 0.39, 0.1, 6, 900).is_linear
    assert Additivity(0.058, 0.01, 2.2, 0.0, 6, 900).is_linear
    assert not Additivity(0.062, 0.01, 2.2, 0.0, 6, 900).is_linear


def test_the_deviation_of_a_single_pair_is_that_of_its_median_over_independent_edges() -> None:
    rng, pixels, noise = np.random.default_rng(0), 3600, 0.02
    one, other = 0.5 + rng.normal(0, noise, (2, pixels))
    mixed = np.stack([one, other, np.ones(pixels), np.zeros(pixels)])
    found = additivity([MixedLight(mixed, np.empty((4, 0)))])
    assert found is not None
    # The median's deviation is 1.25 of the mean's; nine neighbours are one observation.
    assert found.excess_std == pytest.approx(1.2533 * noise * 2**0.5 / (pixels / 9) ** 0.5, rel=0.05)


def test_of_a_large_picture_only_some_pixels_are_kept() -> None:
    row = np.repeat([3000, 1500, 100, 1500], 20).astype(np.uint16)
    one = np.tile(row, (400, 3))
    white, black = np.full_like(one, 3050), np.full_like(one, 90)
    found = mixed_light((one, 3100 - one), white, black, FULL_DN)
    assert found is not None
    for values in (found.mixed, found.pure):
        assert 4000 < values.shape[1] <= 8000


def test_decoding_undoes_encoding() -> None:
    light = np.linspace(0, 1, 33)
    np.testing.assert_allclose(srgb_decode(srgb_encode(light)), light, atol=2e-5)


def lone(encode: Encoding, period_px: float, blur_px: int = 9) -> StripeLight | None:
    """A wall under slanted stripes of a period without their inverse, blurred by the lens."""
    x = (np.arange(240 + blur_px - 1) + 0.3 * np.arange(60)[:, None]) / period_px
    stripes = (x % 1 < 0.5).astype(float)
    share = np.stack([np.convolve(row, np.ones(blur_px) / blur_px, "valid") for row in stripes])
    albedo = np.linspace(0.4, 1.0, 60)[:, None]

    def frame(light: Floats) -> NDArray[np.uint16]:
        return np.asarray(np.rint(encode(0.02 + 0.8 * light) * FULL_DN), np.uint16)

    return stripe_light(frame(albedo * share), frame(albedo + 0 * share), frame(0 * share), FULL_DN)


@pytest.mark.parametrize(
    ("encode", "exponent"), [(linear, 1.0), (srgb_encode, 2.2), (lambda light: light ** (1 / 1.5), 1.5)]
)
def test_fine_stripes_without_inverse_have_half_of_white_in_linear_values(
    encode: Encoding, exponent: float
) -> None:
    found = additivity(lone(encode, period) for period in (12.0, 17.0, 24.0))
    assert found is not None
    assert found.alone
    assert found.pairs == 3
    assert found.exponent == pytest.approx(exponent, abs=0.15)
    assert found.is_linear == (exponent == 1)
    assert found.is_srgb == (exponent == 2.2)
    assert "% of the contrast" in found.figure


def test_few_or_sharp_stripes_without_inverse_say_nothing() -> None:
    assert lone(linear, 150.0) is None, "parts of the picture see more bright than dark ones"
    assert lone(linear, 24.0, blur_px=1) is None, "no light is mixed"
    assert lone(linear, 24.0) is not None
