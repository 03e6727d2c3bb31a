"""Pictures predicted from lines and from earlier settings, and the pixels that tell two of them apart."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import (
    Expected,
    Lit,
    black_gained,
    brightness_of_lines,
    brightness_of_picture,
    contest_of_lines,
    contest_of_pictures,
    contest_of_places,
    is_lit_elsewhere,
    is_over_white,
    line_profile,
    rescaled,
)
from dsl_core.capture.proof.raster import Raster
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Role, Shot
from dsl_core.model.rig import Sensor

#: Variance of counts: light above 100 DN over 10, and 0.35.
NOISE = Noise(Sensor(black_level_dn=100.0, electrons_per_dn=10.0, read_noise_dn=0.5))
PLAN = CapturePlan(
    camera_size_px=(32, 16),
    projector_size_px=(40, 8),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=4, step_px=4, period_px=20),
)


def shot(role: Role, pattern: int = 0) -> Shot:
    return Shot(0, role, pattern, 0, 10.0, 0.5)


def floats(values: object) -> NDArray[np.float32]:
    return np.asarray(values, np.float32)


def test_a_line_gives_its_neighbours_fifteen_percent_each() -> None:
    found = line_profile(PLAN, shot("spectral", 1))
    assert found is not None
    one = [0.15, 0.85, 1.0, 1.0, 0.85, 0.15]
    wanted = np.zeros(40)
    wanted[3:9] = wanted[23:29] = one
    assert found == pytest.approx(np.repeat(wanted, 3), abs=1e-6)
    first = line_profile(PLAN, shot("spectral", 0))
    assert first is not None
    assert first[:15:3] == pytest.approx([1.0, 1.0, 1.0, 0.85, 0.15]), "the frame's edge goes on"


def test_white_black_and_codes_as_profiles() -> None:
    white, black = line_profile(PLAN, shot("white")), line_profile(PLAN, shot("black"))
    assert white is not None
    assert black is not None
    assert white.tolist() == [1.0] * 120
    assert black.tolist() == [0.0] * 120
    assert line_profile(PLAN, shot("code")) is None


def lit(count: int, contrast: float = 1000.0) -> Lit:
    """Every second pixel of a picture, each at a column and channel of its own."""
    even = np.full(count, contrast, np.float32)
    return Lit(
        2 * np.arange(count),
        np.arange(count, dtype=np.int32),
        floats(np.full(count, 120)),
        even,
        floats(even / 20),
    )


def test_pixels_vote_where_two_patterns_differ_by_three_tenths() -> None:
    seen = np.full(60, 120, np.uint16)
    seen[::2] += 600
    wanted, rival = floats(np.full(30, 0.6)), floats(np.full(30, 0.29))
    found = contest_of_lines(seen, lit(30), wanted, rival)
    assert (found.count, found.mean) == (30, 1.0)
    assert contest_of_lines(seen, lit(30), rival, wanted).mean == -1.0
    assert contest_of_lines(seen, lit(30), wanted, wanted - floats(0.29)).count == 0


@pytest.mark.parametrize(
    "marked", [[], [4], [4, 5, 6], [0, 1, 7, 29], [29], list(range(0, 20, 2)), list(range(30))]
)
def test_pixels_of_marked_columns_are_found_in_their_order(marked: list[int]) -> None:
    key = np.random.default_rng(3).integers(0, 28, 400)
    flat = floats(np.ones(key.size))
    keys = np.isin(np.arange(30), marked)
    found = Lit(np.arange(key.size), key, flat, flat, flat).where(keys)
    assert found.tolist() == np.flatnonzero(keys[key]).tolist()


@pytest.mark.parametrize(("count", "asked"), [(7999, 7999), (8000, 2667), (12000, 4000)])
def test_of_many_pixels_some_thousand_are_asked(count: int, asked: int) -> None:
    ones, none = floats(np.ones(count)), floats(np.zeros(count))
    assert contest_of_lines(np.zeros(2 * count, np.uint16), lit(count), ones, none).count == asked


def test_brightness_is_light_over_light_wanted_of_bright_pixels_that_are_not_saturated() -> None:
    wanted = floats([0.09] * 10 + [0.49] * 10 + [1.0] * 10 + [0.51] * 10)
    seen = np.full(80, 120, np.uint16)
    seen[::2] += (800 * wanted).round().astype(np.uint16)
    assert brightness_of_lines(seen, lit(40), wanted, NOISE) == pytest.approx(0.8, rel=1e-3)
    seen[:40] = 3000  # less than half of the brightest: on the flank of a line
    seen[58] = 4095
    assert brightness_of_lines(seen, lit(40), wanted, NOISE) == pytest.approx(0.8, rel=1e-3)


@pytest.mark.parametrize(("count", "contrast", "is_told"), [(12, 1000, True), (11, 1000, False)])
def test_brightness_needs_twelve_pixels(count: int, contrast: float, is_told: bool) -> None:
    seen = np.full(2 * count, 500, np.uint16)
    assert (
        brightness_of_lines(seen, lit(count, contrast), floats(np.ones(count)), NOISE) is not None
    ) == is_told


@pytest.mark.parametrize(("light", "is_told"), [(24.5, False), (25.5, True)])
def test_brightness_is_that_of_twenty_five_deviations_of_all_pixels_together(
    light: float, is_told: bool
) -> None:
    # Sixteen pixels of deviation one: four together.
    some = Lit(
        np.arange(16),
        np.arange(16, dtype=np.int32),
        floats(np.zeros(16)),
        floats(np.full(16, light / 4)),
        floats(np.ones(16)),
    )
    found = brightness_of_lines(np.full(16, 7, np.uint16), some, floats(np.ones(16)), NOISE)
    assert found == (pytest.approx(28 / light) if is_told else None)


def test_a_picture_of_another_setting_is_its_light_times_that_of_the_setting() -> None:
    picture = np.array([300, 200, 4095, 4095], np.uint16)
    old_black = np.array([200, 200, 200, 3900], np.uint16)
    found = rescaled(picture, old_black, floats([150, 150, 150, 150]), 2.0, NOISE)
    assert found.counts == pytest.approx([350, 150, 4095, 540])
    # Twice squared, of picture and black: (200 + 100) / 10 + 0.7, and so on.
    assert found.variance[:3] == pytest.approx([4 * 30.7, 4 * 20.7, 4 * (399.5 + 10 + 0.7)], rel=1e-3)
    assert np.isinf(found.variance[3]), "nobody knows how bright a saturated pixel was"


def test_places_are_told_by_pixels_whose_prediction_the_columns_explain() -> None:
    some = lit(40)
    right, away = (floats(np.arange(40) // 10 % 2 == side) for side in (0, 1))
    light = floats(np.full(40, 1000))
    counts, seen = floats(np.full(80, 120)), np.full(80, 120, np.uint16)
    counts[::2] += light * right
    seen[::2] += (light * away).astype(np.uint16)
    wanted, dark = Expected(counts, floats(np.full(80, 9))), (floats(np.full(80, 120)), 1.0)
    contest = contest_of_places(seen, wanted, some, dark, (right, away), NOISE)
    assert (contest.count, contest.mean) == (40, -1.0)
    as_wanted = contest_of_places(counts.astype(np.uint16), wanted, some, dark, (right, away), NOISE)
    assert (as_wanted.count, as_wanted.mean) == (40, 1.0)
    counts[:10] += 400  # light beyond the line
    assert contest_of_places(seen, wanted, some, dark, (right, away), NOISE).count == 35
    noisy = Expected(counts, floats(np.full(80, 1e6)))
    assert contest_of_places(seen, noisy, some, dark, (right, away), NOISE).count == 0


def test_a_place_whose_light_saturates_either_way_says_nothing() -> None:
    some, full = lit(40), NOISE.sensor.full_scale_dn
    dark, one, other = (floats(np.full(80, 120)), 100.0), floats(np.ones(40)), floats(np.full(40, 0.15))
    wanted = Expected(floats(np.full(80, full)), floats(np.full(80, 9)))
    seen = np.full(80, full, np.uint16)
    assert contest_of_places(seen, wanted, some, dark, (one, other), NOISE).count == 0


def pictures(
    apart: float, light: float, variance: float, count: int = 50
) -> tuple[Expected, Expected, NDArray[np.float32]]:
    """A picture with so much light, one darker by ``apart``, and black."""
    black = floats(np.full(count, 100))
    each = floats(np.full(count, variance))
    return Expected(black + light, each), Expected(black + (light - apart), each), black


@pytest.mark.parametrize(("apart", "is_told"), [(290.0, False), (310.0, True)])
def test_pictures_are_told_apart_by_three_tenths_of_their_light(apart: float, is_told: bool) -> None:
    raster, none = Raster((10, 5)), floats(np.zeros(50))
    wanted, rival, black = pictures(apart, 1000.0, 0.1)
    seen = wanted.counts.astype(np.uint16)
    found = contest_of_pictures(seen, wanted, rival, black, none, NOISE, raster)
    assert (found.count, found.mean) == ((50, 1.0) if is_told else (0, 1.0))
    assert contest_of_pictures(seen, rival, wanted, black, none, NOISE, raster).is_lost == is_told
    least = floats(np.full(50, 320.0))
    assert contest_of_pictures(seen, wanted, rival, black, least, NOISE, raster).count == 0


@pytest.mark.parametrize(("apart", "is_told"), [(59.0, False), (61.0, True)])
def test_pictures_are_told_apart_by_six_deviations_of_all_three(apart: float, is_told: bool) -> None:
    # Seen 97 DN of black level and noise 0.35, both predictions 49.825: a deviation of ten together.
    wanted, rival, black = pictures(apart, apart, 49.825)
    found = contest_of_pictures(
        np.full(50, 90, np.uint16), wanted, rival, black, floats(np.zeros(50)), NOISE, Raster((10, 5))
    )
    assert (found.count == 50) == is_told


@pytest.mark.parametrize(("apart", "asked"), [(9000, 3000), (60, 60)])
def test_pictures_are_told_apart_by_some_of_many_pixels_and_by_all_of_few(apart: int, asked: int) -> None:
    wanted, rival, black = pictures(500.0, 500.0, 4.0, 9000)
    known = np.arange(9000) < apart
    rival = Expected(rival.counts, np.where(known, rival.variance, np.float32(1e9)))
    seen = wanted.counts.astype(np.uint16)
    found = contest_of_pictures(seen, wanted, rival, black, None, NOISE, Raster((100, 90)))
    assert (found.count, found.mean) == (asked, 1.0)


def test_where_pixels_are_too_noisy_blocks_are_asked() -> None:
    raster = Raster((32, 32))
    assert raster.pooled == 4
    count = 32 * 32
    # Blocks of four have half the deviation.
    for apart, asked in ((40.0, 256), (29.0, 0)):
        wanted, rival, black = pictures(apart, apart, 49.825, count)
        seen = np.full(count, 90, np.uint16)
        found = contest_of_pictures(seen, wanted, rival, black, floats(np.zeros(count)), NOISE, raster)
        assert (found.count, found.is_lost) == (asked, asked > 0)


def test_brightness_of_a_picture_leaves_out_what_is_or_should_be_saturated() -> None:
    black = floats(np.full(40, 100))
    wanted = Expected(black + 1000, floats(np.full(40, 1.0)))
    seen = np.full(40, 600, np.uint16)
    assert brightness_of_picture(seen, wanted, black, NOISE, None, None) == pytest.approx(0.5)
    seen[0] = 4095
    counts = wanted.counts.copy()
    counts[1] = 3690  # nine tenths of full scale are 3685.5
    assert brightness_of_picture(
        seen, Expected(counts, wanted.variance), black, NOISE, None, None
    ) == pytest.approx(0.5)
    counts[1] = 3680
    assert brightness_of_picture(
        seen, Expected(counts, wanted.variance), black, NOISE, None, None
    ) == pytest.approx(19500 / 41580)
    assert (
        brightness_of_picture(
            seen[:11], Expected(counts[:11], wanted.variance[:11]), black[:11], NOISE, None, None
        )
        is None
    )


def test_brightness_of_a_picture_asks_for_light_beyond_both_noises() -> None:
    black = floats(np.full(16, 100))
    # Variance 5.65 of the prediction and 10.35 of the picture: sixteen pixels, a deviation of sixteen.
    for light, is_told in ((24.0, False), (26.0, True)):
        wanted = Expected(black + light, floats(np.full(16, 5.65)))
        found = brightness_of_picture(np.full(16, 200, np.uint16), wanted, black, NOISE, None, None)
        assert (found is not None) == is_told


def test_noise_that_is_scaled_up_with_a_picture_does_not_make_it_brighter() -> None:
    noise, rng = (
        Noise(Sensor(black_level_dn=100.0, electrons_per_dn=10.0, read_noise_dn=4.0)),
        np.random.default_rng(5),
    )
    true = np.where(np.arange(20_000) < 400, 60.0, 1.0)

    def picture(light: NDArray[np.float64], room: float) -> NDArray[np.uint16]:
        return np.asarray(np.rint(100 + room + light + rng.normal(0, 4, light.shape)), np.uint16)

    dark = np.zeros_like(true)
    old_black, new_black = picture(dark, 6.0), picture(dark, 12.0)
    wanted = rescaled(picture(true, 6.0), old_black, floats(new_black), 40.0, noise)
    seen = picture(40 * true, 12.0)
    share = brightness_of_picture(seen, wanted, floats(new_black), noise, None, None)
    assert share is not None
    assert share == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("room", [-4, 0, 7])
def test_light_of_the_room_that_changed_is_not_taken_for_that_of_a_line(room: int) -> None:
    wanted = floats(np.r_[np.ones(20), np.zeros(60)])
    seen = np.full(160, 120 + room, np.uint16)
    seen[:40:2] += 8
    assert brightness_of_lines(seen, lit(80, 10.0), wanted, NOISE) == pytest.approx(0.8, rel=1e-3)
    few = brightness_of_lines(seen[:158], lit(79, 10.0), wanted[:79], NOISE)
    assert few == pytest.approx((8 + room) / 10, rel=1e-3), "59 unlit pixels say too little"


@pytest.mark.parametrize(("then", "now"), [(0, 0), (0, 40), (30, 0), (-9, 25)])
def test_light_of_the_room_that_changed_is_not_taken_for_that_of_a_picture(then: int, now: int) -> None:
    # A line of an earlier setting, scaled with the room's light of its time, against that of today.
    pattern, known = floats(np.r_[np.ones(20), np.zeros(60)]), lit(80)
    light = np.zeros(160)
    light[:40:2] = 500
    black = floats(np.full(160, 110))
    wanted = Expected(floats(black + light + then), floats(np.full(160, 2000.0)))
    seen = (110 + now + 0.8 * light).astype(np.uint16)
    assert brightness_of_picture(seen, wanted, black, NOISE, known, pattern) == pytest.approx(0.8, rel=1e-3)
    share = (0.8 * 10_000 + 160 * now) / (10_000 + 160 * then)
    quiet = Expected(wanted.counts, floats(np.full(160, 1.0)))
    assert brightness_of_picture(seen, quiet, black, NOISE, None, pattern) == pytest.approx(share, rel=1e-3)


@pytest.mark.parametrize(("more", "found"), [(0, 0.0), (16, 16.0), (-9, -9.0)])
def test_black_that_has_gained_is_told_from_first_orders_by_pixels_that_these_do_not_reach(
    more: int, found: float
) -> None:
    wanted, count = floats(np.r_[np.ones(200), np.zeros(1800)]), 2000
    some = Lit(
        np.arange(count), np.arange(count), floats(np.full(count, 120)), floats(np.full(count, 900)),
        floats(np.ones(count)),
    )  # fmt: skip
    # As wide as two pictures of this variance are apart.
    noise = np.random.default_rng(2).normal(0, np.sqrt(2 * (2.0 + 0.35)), count)
    light = np.r_[np.full(800, 50.0), np.zeros(1200)]
    seen = np.rint(120 + more + light + noise).astype(np.uint16)
    assert black_gained(seen, some, wanted, NOISE) == pytest.approx(found, abs=0.8 if found else 0)
    assert black_gained(seen, some, floats(np.ones(count)), NOISE) == 0, "all pixels are lit"


def test_what_black_has_gained_is_told_whatever_its_noise() -> None:
    wanted, count = floats(np.r_[np.ones(200), np.zeros(1800)]), 2000
    flat = floats(np.full(count, 300))
    some = Lit(np.arange(count), np.arange(count), flat, 3 * flat, floats(np.ones(count)))
    noise = np.random.default_rng(2).normal(0, np.sqrt(2 * (20.0 + 0.35)), count)
    seen = np.rint(300 + 60 + noise).astype(np.uint16)
    assert black_gained(seen, some, wanted, NOISE) == pytest.approx(60, abs=0.8)


def test_what_black_has_gained_is_not_multiplied_with_the_light() -> None:
    picture, black = np.array([316, 216], np.uint16), np.array([200, 200], np.uint16)
    found = rescaled(picture, black, floats([150, 150]), 30.0, NOISE, np.float32(16))
    assert found.counts == pytest.approx([150 + 30 * 100, 150])


@pytest.mark.parametrize(("bright", "is_told"), [(125, False), (126, True)])
def test_a_fifth_of_the_pixels_bright_where_it_should_be_dark_shows_another_pattern(
    bright: int, is_told: bool
) -> None:
    count = 700
    index = np.arange(count)
    whole = Lit(index, index % 30, floats(np.full(count, 100)), floats(np.full(count, 200)), floats(index))
    wanted = np.zeros(30, np.float32)
    wanted[:3] = 1
    seen = np.full(count, 180, np.uint16)
    seen[index % 30 < 3] = 300
    seen[np.flatnonzero(index % 30 >= 3)[:bright]] = 210
    assert is_lit_elsewhere(seen, whole, wanted) == is_told


@pytest.mark.parametrize(
    ("counts", "pixels", "is_told"), [(365, 12, True), (365, 11, False), (355, 12, False), (380, 12, True)]
)
def test_a_window_is_told_by_pixels_brighter_than_white_beside_the_line(
    counts: int, pixels: int, is_told: bool
) -> None:
    index = np.arange(700)
    some = Lit(index, index % 30, floats(index * 0 + 100), floats(index * 0 + 200), floats(index * 0 + 1))
    wanted = np.zeros(30, np.float32)
    wanted[:3] = 1
    seen = np.full(700, 120, np.uint16)
    seen[index % 30 < 3] = 500
    assert not is_over_white(seen, some, wanted), "the line itself may be"
    seen[np.flatnonzero(index % 30 >= 3)[:pixels]] = counts
    assert is_over_white(seen, some, wanted) == is_told
