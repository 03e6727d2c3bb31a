"""Pictures taken again of a light that has changed meanwhile."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.code.code_pairs import ALIKE
from dsl_core.capture.proof.code.first_light import (
    _factor,
    changed_light,
    flickers,
    has_moved,
    is_unlit,
    light_of_pairs,
    light_of_words,
    unsettled_pairs,
    unsettled_words,
)
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.rig import Sensor

SENSOR = Sensor()
NOISE = Noise(SENSOR)
RASTER = Raster((20, 20))
#: Colours of 400 pixels, a third each.
COLOURS = np.asarray(np.arange(400) % 3, np.int8)


def pictures(light: float, order: tuple[int, ...] = (0, 1, 2, 3), gain: float = 1.0) -> dict[int, Counts]:
    """Two pairs of stripes over 400 pixels."""
    rng, place = np.random.default_rng(0), np.arange(400)
    stripes = [(place // 40) % 2, 1 - (place // 40) % 2, (place // 20) % 2, 1 - (place // 20) % 2]
    noise = [rng.normal(0, 0.6, 400) for _ in stripes]
    return {
        n: np.clip(gain * (SENSOR.black_level_dn + light * stripes[k] + noise[k]), 0, 4095).astype(np.uint16)
        for n, k in enumerate(order)
    }


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.9])
def test_light_that_changed_between_two_pairs_is_told_with_its_factor(factor: float) -> None:
    before = {**pictures(1000), **{n: p for n, p in pictures(1000 * factor).items() if n > 1}}
    found = changed_light(before, pictures(1000 * factor), NOISE, COLOURS)
    assert found == pytest.approx(factor, abs=0.05)


def test_a_gain_that_takes_the_black_level_with_it_is_told() -> None:
    assert changed_light(pictures(800), pictures(800, gain=2.0), NOISE, COLOURS) == pytest.approx(2, abs=0.05)


def test_colours_that_changed_unlike_are_told_by_the_one_that_did_most() -> None:
    warm = np.array([1.0, 0.85, 0.45])[COLOURS]
    level = SENSOR.black_level_dn
    now = {n: np.rint(level + (p - level) * warm).astype(np.uint16) for n, p in pictures(1000).items()}
    before = {n: pictures(1000)[n] if n < 2 else now[n] for n in now}
    assert changed_light(before, now, NOISE, COLOURS) == pytest.approx(0.45, abs=0.03)


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.9])
def test_one_wrong_picture_is_no_change_of_the_light(factor: float) -> None:
    before = pictures(1000)
    before[2] = pictures(1000 * factor)[2]
    assert changed_light(before, pictures(1000), NOISE, COLOURS) is None


@pytest.mark.parametrize("order", [(0, 2, 1, 3), (0, 0, 2, 3), (0, 0, 1, 2), (0, 1, 1, 3)])
def test_pictures_of_other_patterns_say_nothing_of_the_light(order: tuple[int, ...]) -> None:
    assert changed_light(pictures(1000, order), pictures(1000), NOISE, COLOURS) is None


def test_little_light_and_drift_are_not_told() -> None:
    assert changed_light(pictures(8), pictures(0), NOISE, COLOURS) is None
    assert changed_light(pictures(1000), pictures(1300), NOISE, COLOURS) is None


@pytest.mark.parametrize("light", [40, 1000])
@pytest.mark.parametrize(("columns", "is_told"), [(0, False), (1, True), (-2, True)])
def test_a_pattern_and_its_inverse_that_moved_are_told_by_the_edges_of_stripes(
    columns: int, is_told: bool, light: int
) -> None:
    before, now = pictures(light), {n: np.roll(each, columns) for n, each in pictures(light).items()}
    assert has_moved((before[0], before[1]), (now[0], now[1]), NOISE) == is_told


@pytest.mark.parametrize("order", [(1, 0), (0, 0), (0, 2), (3, 0), (2, 2)])
def test_exchanged_and_wrong_pictures_have_not_moved(order: tuple[int, int]) -> None:
    now = pictures(1000)
    for light in (1000, 500, 0):
        before = pictures(light)
        assert not has_moved((before[order[0]], before[order[1]]), (now[0], now[1]), NOISE)
    assert not has_moved((now[0], now[1]), (now[order[0]], now[order[1]]), NOISE)


def even(*light: float) -> dict[int, Counts]:
    """Pictures by pattern, each of one brightness all over."""
    return {n: np.full(400, SENSOR.black_level_dn + each, np.uint16) for n, each in enumerate(light)}


def test_light_is_what_exceeds_the_black_level() -> None:
    found = changed_light(even(1000, 0, 1000, 0), even(500, 0, 500, 0), NOISE, COLOURS)
    assert found == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(("light", "is_told"), [(25, True), (35, False)])
def test_a_first_picture_with_enough_light_says_that_nothing_has_changed(light: int, is_told: bool) -> None:
    # Three per cent of the light of all.
    before, now = even(1000, light, 1000, 0), even(500, light, 500, 0)
    assert (changed_light(before, now, NOISE, COLOURS) is not None) == is_told


def test_a_pair_is_unlit_if_no_pixel_prefers_the_pattern_or_its_inverse() -> None:
    dark, lit = pictures(0), pictures(100)
    assert is_unlit(dark[0], dark[1], NOISE, RASTER)
    assert not is_unlit(lit[0], lit[1], NOISE, RASTER)


@pytest.mark.parametrize(("sigmas", "pixels", "unlit"), [(6, 1, False), (4, 400, True), (6, 0, True)])
def test_a_pixel_in_a_thousand_six_deviations_bright_is_lit(sigmas: float, pixels: int, unlit: bool) -> None:
    one, other = even(2000, 2000).values()
    bright = round(sigmas * float(np.sqrt(2 * NOISE.variance(one)[0])))
    one[:pixels] += np.uint16(bright)
    assert is_unlit(one, other, NOISE, RASTER) == unlit


@pytest.mark.parametrize(
    ("bits", "faint_dn", "flicker", "unlit"),
    [(8, 2.0, 1.0, False), (12, 9.0, 1.0, False), (12, 0.0, 1.0, True), (12, 0.0, 1.01, True)],
)
def test_the_dark_setting_of_a_plan_is_lit_and_light_that_flickers_is_no_pattern(
    bits: int, faint_dn: float, flicker: float, unlit: bool
) -> None:
    """Of a camera that nobody has calibrated, in a lit room."""
    raster, rng, room = Raster((160, 96)), np.random.default_rng(0), 40.0 * 2 ** (bits - 8)
    half = np.arange(160) < 80

    def seen(stripe: np.ndarray, light: float) -> Counts:
        mean = np.tile(room * light + faint_dn * stripe, (96, 1))
        noise = 0.5 * 2 ** (bits / 2 - 4) * rng.standard_normal(mean.shape)
        return raster.take(np.rint(mean + noise).astype(np.uint16))

    one, other = seen(half, flicker), seen(~half, 1.0)
    assert is_unlit(one, other, Noise.of(None, bits), raster) == unlit


@pytest.mark.parametrize(("light", "wrong"), [(0.97, {0, 2}), (0.99, set()), (1.03, {0, 2})])
def test_pairs_of_other_light_than_the_last_ones_have_not_settled(light: float, wrong: set[int]) -> None:
    usual = pictures(1000.0)
    white, black = (np.full(400, SENSOR.black_level_dn + light, np.uint16) for light in (1000, 0))
    other = pictures(1000.0 * light)
    pairs = {n: (other[0], other[1]) if n in (0, 2) else (usual[2], usual[3]) for n in range(5)}
    lit = np.ones(400, bool)
    found = unsettled_pairs(light_of_pairs(pairs, (white, black), lit, NOISE))
    assert {number for number, ratio in found.items() if abs(ratio - light) < 0.01} == wrong
    assert set(found) == {number + side for number in wrong for side in (-1, 0, 1)} - {-1}, (
        "those beside, too"
    )
    # Of few pixels nothing is known, and where the last pair differs the ends may be wrong.
    assert unsettled_pairs(light_of_pairs(pairs, (white, black), np.arange(400) < 59, NOISE)) == {}
    assert unsettled_pairs(light_of_pairs({**pairs, 4: pairs[0]}, (white, black), lit, NOISE)) == {}


@pytest.mark.parametrize(
    ("light", "again"),
    [
        ([0.9, 0.9, 0.9, 1.0, 1.0], {}),  # at once: both lights are still to be seen
        ([0.9, 0.9, 0.95, 1.0, 1.0], {2: 0.95}),
        ([0.9, 0.9, 0.9, 0.9, 0.95], {4: 0.95}),
        ([0.9, 1.0, 1.0, 1.0, 1.0], {0: 0.9, 1: 1.0}),
        ([0.85, 0.9, 0.93, 0.96, 1.0], {0: 0.85, 1: 0.9, 2: 0.93, 3: 0.96, 4: 1.0}),
        ([0.97, 1.03, 0.98, 1.02, 1.0], {}),  # it flickers, and will do so again
        ([0.9, 0.9, 1.0, 0.9, 1.0], {0: 0.9, 1: 0.9, 2: 1.0, 3: 0.9, 4: 1.0}),
    ],
)
def test_of_light_that_changed_at_once_only_the_pair_of_both_is_taken_again(
    light: list[float], again: dict[int, float]
) -> None:
    white, black = (np.full(400, SENSOR.black_level_dn + each, np.uint16) for each in (1000, 0))
    of_light = [pictures(1000.0 * share) for share in light]
    pairs = {number: (each[2 * number % 4], each[2 * number % 4 + 1]) for number, each in enumerate(of_light)}
    found = unsettled_pairs(light_of_pairs(pairs, (white, black), np.ones(400, bool), NOISE))
    assert found == pytest.approx(again, abs=0.01)


@pytest.mark.parametrize(
    ("light", "is_told"),
    [
        ([0.97, 1.03, 0.98, 1.02, 1.0], True),
        ([0.94, 1.0, 0.95, 0.99, 0.97], True),  # white was bright
        ([0.985, 1.015, 0.985, 1.015, 1.0], False),
        ([0.9, 1.03, 0.995, 1.0, 1.0], False),  # a lamp that overshoots
        ([1.0, 1.0, 0.9, 1.0, 1.0], False),
        ([], False),
    ],
)
def test_light_that_turns_again_and_again_flickers(light: list[float], is_told: bool) -> None:
    assert flickers(dict(enumerate(light))) == is_told


def test_the_light_of_first_pictures_is_read_from_why_they_were_taken_again() -> None:
    assert light_of_words(f"its brightness is wrong ({unsettled_words(0.913)})") == 0.91
    assert light_of_words("its brightness is wrong (0.91 times what was expected)") is None


@pytest.mark.parametrize(("share", "is_alike"), [(0.7, True), (1.3, False)])
def test_of_brighter_pictures_more_may_be_left(share: float, is_alike: bool) -> None:
    """What a change of the light leaves of a pair, as a share of what is taken for another pattern."""
    one = np.full(400, 100.0, np.float32)
    other = 3 * one * (1 + share * ALIKE * np.where(np.arange(400) % 2, 1, -1).astype(np.float32))
    factor, alike = _factor(one, other, np.zeros(400, np.int8))
    assert factor == pytest.approx(3)
    assert alike == is_alike
