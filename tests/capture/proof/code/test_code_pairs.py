"""A code judged by its own pictures: what is lit, what breaks a sum, and what explains a broken one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import CodePairs, Pair, alike, dominant, end_of
from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.noise import Noise
from dsl_core.model.rig import Sensor

#: Variance of counts: light above 100 DN over 10, and 0.35.
NOISE = Noise(Sensor(black_level_dn=100.0, electrons_per_dn=10.0, read_noise_dn=0.5))


def counts(values: object) -> NDArray[np.uint16]:
    return np.asarray(values, np.uint16)


def pairs_of(*pairs: Pair) -> CodePairs:
    found = CodePairs(NOISE)
    found.pairs.update(enumerate(pairs))
    return found


def stripes(contrast_dn: float, count: int = 1000) -> Pair:
    """Pattern and inverse of a stripe for every second pixel."""
    pattern = counts(100 + contrast_dn * (np.arange(count) % 2))
    return pattern, counts(200 + contrast_dn - pattern)


def test_contrast_is_between_the_darkest_and_the_brightest_of_all_pairs() -> None:
    known = pairs_of((counts([100, 900]), counts([500, 110])), (counts([300, 120]), counts([120, 1000])))
    dark, bright, lit = known.contrast()
    assert dark.tolist() == [100, 110]
    assert bright.tolist() == [500, 1000]
    assert lit.all()
    assert known.contrast([(counts([50, 500]), counts([600, 500]))])[0].tolist() == [50, 110]


@pytest.mark.parametrize(("contrast_dn", "is_lit"), [(19, False), (20, True)])
def test_a_pixel_is_lit_from_twelve_deviations_on(contrast_dn: int, is_lit: bool) -> None:
    # c > 12 sqrt(c / 10 + 0.7) from c = 19.55 on.
    assert pairs_of(stripes(contrast_dn)).contrast()[2].all() == is_lit


def test_saturated_pixels_say_nothing_unless_only_the_new_pair_saturates_them() -> None:
    full = counts([4095, 900]), counts([100, 100])
    assert pairs_of(full).contrast()[2].tolist() == [False, True]
    below = counts([4094, 900]), counts([100, 100])
    assert pairs_of(below).contrast([full])[2].tolist() == [True, True]


def test_the_expected_sum_is_the_median_of_the_last_nine_pairs() -> None:
    assert CodePairs(NOISE).sum() is None
    ten = pairs_of(*((counts([100 * k]), counts([7])) for k in range(10)))
    assert ten.sum() == pytest.approx(507)


@pytest.mark.parametrize(("lit", "most"), [(1000, 8), (4000, 20)])
def test_more_than_eight_pixels_and_half_a_percent_break_a_sum(lit: int, most: int) -> None:
    known = pairs_of(stripes(1000, lit))
    expected = known.sum()
    for number in (most, most + 1):
        pattern, inverse = stripes(1000, lit)
        inverse[:number] += 500
        broken = known.broken((pattern, inverse), expected)
        assert (broken is not None) == (number > most)
    assert broken is not None
    assert np.flatnonzero(broken).tolist() == list(range(most + 1))
    assert known.broken(stripes(1000, lit), expected) is None
    assert known.broken((pattern, inverse), None) is None


# Three tenths of the contrast where it is strong; where it is weak, six deviations of the sum:
# d > 6 sqrt(2 ((30 + d) / 10 + 0.7)) from d = 20.3 on.
@pytest.mark.parametrize(("contrast_dn", "most"), [(1000, 300), (30, 20)])
def test_a_pixel_breaks_a_sum_by_a_share_of_its_contrast_and_by_its_noise(
    contrast_dn: int, most: int
) -> None:
    known = pairs_of(stripes(contrast_dn))
    for change in (most, most + 1):
        pattern, inverse = stripes(contrast_dn)
        inverse[1:200:2] += counts(change)
        broken = known.broken((pattern, inverse), known.sum())
        assert (broken is not None) == (change > most)


def darker(pair: Pair, pattern: float, inverse: float) -> Pair:
    """Light above black times a factor."""
    return tuple(
        counts(np.round(100 + f * (p - 100.0))) for p, f in zip(pair, (pattern, inverse), strict=True)
    )  # type: ignore[return-value]


def uneven(count: int = 1000) -> Pair:
    """Stripes with some light beside them, under light that falls off to one side."""
    light = np.linspace(500, 1000, count)
    lit = np.where(np.arange(count) % 2, 1.0, 0.1)
    return counts(100 + light * lit), counts(100 + light * (1.1 - lit))


@pytest.mark.parametrize("ratios", [(0.5, 1.0), (1.0, 0.5), (0.67, 1.0), (1.45, 1.0), (2.0, 0.6)])
def test_brightness_alone_explains_a_sum_of_pictures_too_dark_or_bright(ratios: tuple[float, float]) -> None:
    known = pairs_of(uneven())
    expected = known.sum()
    assert expected is not None
    assert known.brightness(darker(uneven(), *ratios), expected) == pytest.approx(ratios, rel=0.01)


@pytest.mark.parametrize("ratios", [(1.0, 1.0), (0.73, 1.0), (1.0, 1.36)])
def test_brightness_near_that_expected_explains_nothing(ratios: tuple[float, float]) -> None:
    known = pairs_of(uneven())
    expected = known.sum()
    assert expected is not None
    assert known.brightness(darker(uneven(), *ratios), expected) is None


@pytest.mark.parametrize(("left", "is_explained"), [(0.07, True), (0.09, False)])
def test_brightness_explains_a_sum_that_it_leaves_eight_percent_of_at_most(
    left: float, is_explained: bool
) -> None:
    known, pair = pairs_of(uneven()), darker(uneven(), 0.5, 1.0)
    expected = known.sum()
    assert expected is not None
    # Every second pair of pixels more, the others less: nothing that the two pictures can follow.
    sign = np.where(np.arange(expected.size) % 4 < 2, 1, -1)
    changed = expected + np.float32(left * (expected.mean() - 200)) * sign.astype(np.float32)
    assert (known.brightness(pair, changed) is not None) == is_explained


def test_two_equal_pictures_and_light_taken_away_are_no_matter_of_brightness() -> None:
    known, (pattern, inverse) = pairs_of(uneven()), uneven()
    expected = known.sum()
    assert expected is not None
    assert known.brightness((pattern, pattern), expected) is None
    assert (
        known.brightness((pattern, inverse), np.float32(200) + (np.float32(200) - expected) / np.float32(4))
        is None
    )


@pytest.mark.parametrize(("apart", "is_alike"), [(7, True), (9, False), (-7, True), (-9, False)])
def test_pictures_are_alike_within_eight_percent_of_the_contrast(apart: int, is_alike: bool) -> None:
    one, contrast, lit = counts(np.full(50, 400)), np.full(50, 100, np.float32), np.ones(50, bool)
    assert alike(one, counts(one.astype(int) + apart), contrast, lit) == is_alike
    assert not alike(one, one, contrast, ~lit)


def test_a_few_pixels_count_no_more_than_their_contrast() -> None:
    one, contrast, lit = counts(np.full(50, 400)), np.full(50, 100, np.float32), np.ones(50, bool)
    other = one.copy()
    other[:3] = 4000
    assert alike(one, other, contrast, lit)
    other[3] = 4000
    assert alike(one, other, contrast, lit) is False
    assert alike(one, other, contrast, np.arange(50) > 3)


def test_a_torn_picture_is_broken_at_one_end_alone() -> None:
    counted = np.ones(40, bool)
    broken = np.zeros(40, bool)
    broken[1] = True  # the second of the first twentieth
    assert end_of(broken, counted)
    assert dominant(broken, counted) is Verdict.TORN
    assert end_of(broken[::-1], counted)
    broken[-1] = True
    assert not end_of(broken, counted)
    assert dominant(broken, counted) is Verdict.OTHER
    assert not end_of(broken[:19], counted[:19]), "too few to tell"
    # Only pixels that count make an end.
    assert end_of(
        np.r_[np.zeros(30, bool), True, np.zeros(39, bool)], np.r_[np.zeros(30, bool), np.ones(40, bool)]
    )


@pytest.mark.parametrize(("lower", "is_torn"), [(1, True), (2, False)])
def test_the_sound_end_is_broken_by_less_than_a_tenth_of_the_other(lower: int, is_torn: bool) -> None:
    broken = np.zeros(400, bool)
    broken[:20] = True
    broken[400 - lower :] = True
    assert end_of(broken, np.ones(400, bool)) == is_torn


def test_a_saturated_white_may_fall_short_of_the_sum_but_not_exceed_it() -> None:
    full = Sensor().full_scale_dn
    pattern = counts(np.where(np.arange(1000) % 2, full - 10, 2500))
    known = pairs_of((pattern, pattern[::-1].copy()))
    expected = known.sum()
    white, black = counts(np.full(1000, full)), counts(np.full(1000, 100))
    assert known.broken((white, black), expected) is None, "light beyond full scale is lost"
    dimmer = counts(np.full(1000, full - 20))
    assert known.broken((dimmer, black), expected) is not None
    assert known.broken((white, counts(np.full(1000, full - 1))), expected) is not None
