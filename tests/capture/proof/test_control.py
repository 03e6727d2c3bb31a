"""Which pictures of the first code are taken once more, and when two takes are the same."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.code.code_pairs import Pair
from dsl_core.capture.proof.control import choose_pairs, edges_moved, is_same, is_unchanged
from dsl_core.capture.proof.noise import Noise
from dsl_core.model.rig import Sensor

SHAPE = (5, 16)
#: Variance of counts: light above 100 DN over 10, and 0.35.
NOISE = Noise(Sensor(black_level_dn=100.0, electrons_per_dn=10.0, read_noise_dn=0.5))


def stripes(width: int, contrast: np.ndarray | float = 100.0, share: float = 1.0) -> Pair:
    """Stripes of so many columns and their inverse, with a share of the contrast of each pixel."""
    light = np.broadcast_to(np.arange(16) // width % 2, SHAPE).ravel()
    half = np.broadcast_to(contrast, SHAPE).ravel() / 2
    one = 200 + half * share * np.where(light, 1, -1)
    return one.round().astype(np.uint16), (400 - one).round().astype(np.uint16)


def test_the_pairs_with_the_most_and_the_fewest_stripes_are_chosen() -> None:
    pairs = {0: stripes(16), 1: stripes(8), 2: stripes(4), 3: stripes(2), 4: stripes(1)}
    assert choose_pairs(pairs, SHAPE, NOISE) == (4, 1), "without a stripe nothing moves"
    assert choose_pairs({0: stripes(16), 2: stripes(4)}, SHAPE, NOISE) == (2,)
    assert choose_pairs({0: stripes(16)}, SHAPE, NOISE) == ()
    assert choose_pairs({}, SHAPE, NOISE) == ()


@pytest.mark.parametrize(("share", "chosen"), [(0.68, (2, 1)), (0.74, (4, 1))])
def test_stripes_need_seven_tenths_of_the_contrast(share: float, chosen: tuple[int, ...]) -> None:
    pairs = {1: stripes(8), 2: stripes(4), 4: stripes(1, share=share)}
    assert choose_pairs(pairs, SHAPE, NOISE) == chosen


@pytest.mark.parametrize(("seen", "chosen"), [(11, (2, 1)), (12, (4, 1))])
def test_stripes_are_seen_in_seven_tenths_of_the_lit_pixels(seen: int, chosen: tuple[int, ...]) -> None:
    part = np.where(np.arange(16) < seen, 1.0, 0.2)
    pairs = {1: stripes(8), 2: stripes(4), 4: stripes(1, 100.0 * part)}
    assert choose_pairs(pairs, SHAPE, NOISE) == chosen


@pytest.mark.parametrize(("contrast", "chosen"), [(40.0, (4, 1)), (60.0, (2, 1))])
def test_pixels_with_less_than_half_the_usual_contrast_do_not_count(
    contrast: float, chosen: tuple[int, ...]
) -> None:
    light = np.where(np.arange(16) < 10, 100.0, contrast)
    part = np.where(np.arange(16) < 10, 1.0, 0.2)
    pairs = {1: stripes(8, light), 2: stripes(4, light), 4: stripes(1, light * part)}
    assert choose_pairs(pairs, SHAPE, NOISE) == chosen


def test_stripes_between_unseen_pixels_are_not_counted() -> None:
    # Of single stripes that every fourth pixel does not see, 7 of 15 changes are seen: as many as of two.
    gaps = np.where(np.arange(16) % 4 == 1, 0.2, 1.0)
    assert choose_pairs({1: stripes(1, 100 * gaps), 2: stripes(2)}, SHAPE, NOISE) == (1,)
    assert choose_pairs({1: stripes(1), 2: stripes(2)}, SHAPE, NOISE) == (1, 2)


@pytest.mark.parametrize(("contrast", "chosen"), [(3.0, ()), (30.0, ()), (45.0, (2, 1))])
def test_nothing_is_a_control_that_noise_alone_makes_another_pattern(
    contrast: float, chosen: tuple[int, ...]
) -> None:
    pairs = {1: stripes(8, contrast), 2: stripes(2, contrast)}
    assert choose_pairs(pairs, SHAPE, NOISE) == chosen


@pytest.mark.parametrize("contrast", [45.0, 70.0])
def test_noise_makes_no_take_another_and_hides_no_motion(contrast: float) -> None:
    """Noise of 3.2 DN makes two takes of 45 DN differ by a twelfth of it."""
    rng = np.random.default_rng(3)

    def taken(exact: np.ndarray) -> np.ndarray:
        return rng.normal(exact, 3.2).round().astype(np.uint16)

    one, other = stripes(8, contrast)
    pairs = {0: (taken(one), taken(other))}
    moved = np.roll(one.reshape(SHAPE), 2, 1).ravel()
    for _ in range(50):
        assert is_same(taken(one), pairs[0][0], pairs, NOISE)
        assert not is_same(taken(moved), pairs[0][0], pairs, NOISE)


def test_a_take_is_the_same_where_light_reaches() -> None:
    one, other = stripes(2)
    pairs = {0: (one, other)}
    assert is_same(one, one, pairs, NOISE)
    assert is_same(one + np.uint16(7), one, pairs, NOISE)
    assert not is_same(one + np.uint16(9), one, pairs, NOISE)
    assert not is_same(other, one, pairs, NOISE)


@pytest.mark.parametrize(("contrast", "is_lit"), [(7, False), (8, True)])
def test_light_reaches_pixels_with_twelve_deviations_of_contrast(contrast: int, is_lit: bool) -> None:
    # The noise of black is the root of 0.35: twelve times that is 7.1 DN.
    black = np.full(80, 100, np.uint16)
    pairs = {0: (black, black + np.uint16(contrast))}
    assert is_same(black, black, pairs, NOISE) == is_lit


@pytest.mark.parametrize(("contrast", "unchanged"), [(1.0, True), (1.02, True), (0.95, False), (1.05, False)])
def test_mist_that_takes_a_twentieth_of_the_contrast_is_a_change_though_the_picture_is_the_same(
    contrast: float, unchanged: bool
) -> None:
    one, other = stripes(2)
    now = (one.mean() + contrast * (one - one.mean()) + 2).round().astype(np.uint16)
    pairs = {0: (one, other)}
    assert is_same(now, one, pairs, NOISE)
    assert is_unchanged(now, one, pairs, NOISE) == unchanged
    assert not is_unchanged(other, one, pairs, NOISE)


@pytest.mark.parametrize(
    ("gains", "unchanged"),
    [((1.0, 1.0), True), ((1.01, 1.01), True), ((1.06, 1.06), False), ((1.06, 0.94), False)],
)
def test_gains_of_colours_that_follow_the_picture_are_a_change(
    gains: tuple[float, float], unchanged: bool
) -> None:
    one, other = stripes(4)
    gain = np.resize(gains, one.size)
    now = (100 + gain * (one - 100.0)).round().astype(np.uint16)
    assert is_same(now, one, {0: (one, other)}, NOISE)
    assert is_unchanged(now, one, {0: (one, other)}, NOISE) == unchanged


ROWS = 40
COLOURS = np.tile(np.array([0, 2], np.int8), (ROWS, 8))
ONE_COLOUR = np.zeros_like(COLOURS)


def edge(at: float, low: float = 120.0, high: float = 280.0, seed: int = 0, noise: float = 3.0) -> np.ndarray:
    """Light from one of sixteen columns on, in forty rows, as pixels see it that are a column wide."""
    share = np.clip(np.arange(16) + 1 - at, 0, 1)
    light = np.tile(low + (high - low) * share, (ROWS, 1))
    return (
        (light + np.random.default_rng(seed).normal(0, noise, light.shape)).round().astype(np.uint16).ravel()
    )


def moved(seen: np.ndarray, before: np.ndarray, colours: np.ndarray = ONE_COLOUR) -> bool:
    on, off = edge(0), edge(16)
    return edges_moved(seen, before, {1: (on, off), 2: (off, on)}, NOISE, (ROWS, 16), colours.ravel())


@pytest.mark.parametrize(("low", "high"), [(120, 280), (120, 240), (140, 300)])
def test_an_edge_that_is_displaced_has_moved_in_any_light(low: float, high: float) -> None:
    before = edge(8.4)
    assert not moved(edge(8.4, low, high, 1), before)
    assert not moved(edge(8.42, low, high, 2), before), "a fiftieth of a pixel is no motion"
    assert moved(edge(8.7, low, high, 3), before)
    assert moved(edge(7.6, low, high, 4), before)


@pytest.mark.parametrize(("at", "is_told"), [(7.6, False), (7.9, True)])
def test_colours_that_a_camera_balances_otherwise_move_no_edge(at: float, is_told: bool) -> None:
    black, gain = 100.0, np.array([1.15, 1.0, 0.87])[COLOURS.ravel()]
    seen = black + gain * (edge(at, 120, 800, 5) - black)
    assert moved(seen.round().astype(np.uint16), edge(7.6, 120, 800), COLOURS) == is_told


def test_without_an_edge_nothing_has_moved() -> None:
    assert not moved(edge(16, seed=1), edge(16))
    assert not moved(edge(8.4)[: 20 * 16].repeat(2), edge(16))


def test_a_noisy_edge_has_moved_from_four_deviations_on() -> None:
    """Noise of 40 DN leaves 0.022 px of doubt about an edge of 400 DN that pixels of forty rows see."""

    def told(by_px: float) -> int:
        pictures = (edge(8.4 + by_px, 400, 800, seed, 40) for seed in range(1, 31))
        return sum(moved(seen, edge(8.4, 400, 800)) for seen in pictures)

    assert [told(by_px) for by_px in (0, 0.05)] == [0, 0]
    assert told(0.125) == 30
