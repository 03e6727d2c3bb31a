"""What is done to pictures on their way is named by the mark that it leaves, and nothing else is named so."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, median_filter

from dsl_core.capture.altered import alteration, ends_early
from dsl_core.model.rig import Sensor

SENSOR = Sensor()
Counts = NDArray[np.float64]


def pictures(
    seed: int, change: Callable[[Counts], Counts] = lambda counts: counts
) -> tuple[NDArray[np.uint16], ...]:
    """White, black and stripes on a scene with texture and colours, of which red has least light."""
    rng = np.random.default_rng(seed)
    texture = 1.5 + 4 * gaussian_filter(np.random.default_rng(4).normal(size=(64, 96)), 2.5)
    colours = np.tile([[0.4, 1.0], [1.0, 0.7]], (32, 48))
    stripes = gaussian_filter((np.arange(96) // 6 % 2).astype(float), 0.7)

    def picture(pattern: Counts | float) -> NDArray[np.uint16]:
        light = 60 * colours + 700 * texture.clip(0.2) * colours * pattern
        sigma = np.sqrt(SENSOR.read_noise_dn**2 + light / SENSOR.electrons_per_dn)
        counts = change(np.rint(SENSOR.black_level_dn + light + rng.normal(0, sigma)))
        return np.rint(counts).clip(0, SENSOR.full_scale_dn).astype(np.uint16)

    return picture(1.0), picture(0.0), picture(stripes)


def of_colours(change: Callable[[Counts], Counts]) -> Callable[[Counts], Counts]:
    """The change of each colour's own picture."""

    def changed(counts: Counts) -> Counts:
        made = counts.copy()
        for at in ((0, 0), (0, 1), (1, 0), (1, 1)):
            made[at[0] :: 2, at[1] :: 2] = change(counts[at[0] :: 2, at[1] :: 2])
        return made

    return changed


def over_black(change: Callable[[Counts], Counts]) -> Callable[[Counts], Counts]:
    return lambda counts: SENSOR.black_level_dn + change(counts - SENSOR.black_level_dn)


def dark_rows(counts: Counts) -> Counts:
    made = counts.copy()
    made[20::8] = SENSOR.black_level_dn
    return made


def numbers(counts: Counts) -> Counts:
    made = counts.copy()
    made[0, :30] = np.random.default_rng(7).integers(0, 4096, 30)
    return made


def in_bands(counts: Counts) -> Counts:
    return over_black(lambda light: light * (1 + 0.1 * np.sin(np.arange(64) / 5))[:, None])(counts)


def noisier(counts: Counts) -> Counts:
    light = counts - SENSOR.black_level_dn
    sigma = np.sqrt((SENSOR.read_noise_dn**2 + light / SENSOR.electrons_per_dn).clip(0))
    return np.asarray(counts + np.random.default_rng(8).normal(0, sigma))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (noisier, "Black has 1.4 times the noise that it had when the scan began, and white has the same"),
        (numbers, "The first row of black holds numbers"),
        (in_bands, "Whole rows of white have other light than when the scan began, by 7 % up and down"),
        (lambda c: c[:, ::-1], "picture is mirrored"),
        (lambda c: c[::-1], "picture is upside down"),
        (lambda c: c[::-1, ::-1], "picture is turned by 180 degrees"),
        (lambda c: np.roll(c, -1, 1), "begins one column later"),
        (lambda c: np.roll(c, -1, 0), "begins one row later"),
        (lambda c: np.roll(c, (-1, -1), (0, 1)), "begins one column and row later"),
        (dark_rows, "6 rows of the picture no longer have any light, the first of them is row 20"),
        (lambda c: np.minimum(c, 1200), "No pixel of white has more than 1200 DN"),
        (
            lambda c: np.minimum(c, np.tile([[500.0, 4095.0], [4095.0, 4095.0]], (32, 48))),
            "No pixel of white in red has more than 500 DN",
        ),
        (lambda c: np.floor(c / 16) * 16, "come in steps of about 16 DN"),
        (lambda c: 4095 * (c / 4095) ** 0.55, "by a power of 0."),
        (of_colours(lambda c: 1.8 * c - 0.8 * gaussian_filter(c, 1.0)), "sharpens its picture"),
        (of_colours(lambda c: median_filter(c, 3)), "Black has 0.2 times the noise"),
    ],
)  # fmt: skip
def test_an_alteration_is_named(change: Callable[[Counts], Counts], said: str) -> None:
    assert said in alteration(pictures(1), pictures(2, change), SENSOR)  # type: ignore[arg-type]


def test_rows_that_only_the_projector_left_dark_are_not_taken_for_failed_ones() -> None:
    white, black, code = pictures(2)
    for each, seed in ((white, 3), (code, 4)):
        each[:17] = pictures(seed)[1][:17]
    said = alteration(pictures(1), (white, black, code), SENSOR)  # type: ignore[arg-type]
    assert said.startswith("17 rows of the picture no longer have any light of the projector")
    assert "their pixels work" in said


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c,
        over_black(lambda c: 0.5 * c),
        over_black(lambda c: 2.0 * c),
        over_black(lambda c: c * np.tile([[0.6, 1.0], [1.0, 1.0]], (32, 48))),
        over_black(lambda c: c * np.where(np.arange(96) < 30, 0.3, 1.0)),
        over_black(lambda c: c * np.where(np.arange(64) < 30, 0.6, 1.0)[:, None]),
        over_black(lambda c: c * (1 + 0.3 * np.sin((np.arange(96) + 2 * np.arange(64)[:, None]) / 30))),
        lambda c: c + 40.0,
        lambda c: np.roll(c, 2, 1),
        of_colours(lambda c: (c + np.roll(c, 1, 1)) / 2),
    ],
    ids=[
        "noise",
        "half the light",
        "twice the gain",
        "red",
        "somebody",
        "somebody above",
        "aslant",
        "room",
        "motion",
        "half a pixel",
    ],
)
def test_other_changes_are_no_alteration(change: Callable[[Counts], Counts]) -> None:
    assert alteration(pictures(1), pictures(2, change), SENSOR) == ""  # type: ignore[arg-type]


def test_black_that_holds_some_of_white_is_mixed_with_it() -> None:
    white, black, code = (each.astype(float) for each in pictures(2))
    mixed = (0.7 * white + 0.3 * code, 0.7 * black + 0.3 * white, 0.7 * code + 0.3 * black)
    now = tuple(np.rint(each).astype(np.uint16) for each in mixed)
    assert "Black, captured after white, holds 0.30 times" in alteration(pictures(1), now, SENSOR)  # type: ignore[arg-type]


@pytest.mark.parametrize("light", [1.0, 0.7])
def test_a_lamp_of_the_room_is_no_mixture(light: float) -> None:
    """It gives most to what reflects most, as the projector does, and adds to white as to black."""
    white, black, code = (each.astype(float) for each in pictures(2))
    lamp = 0.3 * (white - black) * np.tile([[1.4, 1.0], [1.0, 0.5]], (32, 48))
    now = tuple(
        np.rint(black + light * (each - black) + lamp).astype(np.uint16) for each in (white, black, code)
    )
    assert "mixed" not in alteration(pictures(1), now, SENSOR)  # type: ignore[arg-type]


def test_noise_that_a_displaced_picture_had_less_of_before_is_no_gain() -> None:
    displaced = pictures(1, of_colours(lambda c: 0.75 * c + 0.25 * np.roll(c, 1, 1)))
    assert "noise" not in alteration(displaced, pictures(2), SENSOR)  # type: ignore[arg-type]


def test_pictures_that_tell_nothing_are_not_altered() -> None:
    full = tuple(np.full((8, 8), int(SENSOR.full_scale_dn), np.uint16) for _ in range(3))
    assert alteration(full, full, SENSOR) == ""  # type: ignore[arg-type]


@pytest.mark.parametrize(("most_dn", "is_told"), [(1500, True), (4095, False), (290, False)])
def test_a_bright_picture_whose_counts_end_below_full_scale_says_so_alone(
    most_dn: int, is_told: bool
) -> None:
    white = np.minimum(4 * pictures(1)[0].astype(np.uint32), most_dn).astype(np.uint16)
    assert (f"has more than {most_dn} DN" in ends_early(white, SENSOR)) == is_told


def test_a_colour_that_a_digital_white_balance_ends_just_below_full_scale_says_so() -> None:
    white = np.minimum(4 * pictures(1)[0].astype(np.float64), SENSOR.full_scale_dn)
    blue = white[1::2, 1::2]
    blue[...] = np.rint(SENSOR.black_level_dn + 0.92 * (blue - SENSOR.black_level_dn))
    most_dn = int(blue.max())
    assert most_dn > 0.92 * SENSOR.full_scale_dn
    assert f"No pixel of it in blue has more than {most_dn} DN" in ends_early(white.astype(np.uint16), SENSOR)


@pytest.mark.parametrize("end_dn", [4095, 4094, 4080, 3700])
def test_a_brighter_lamp_is_not_an_end_of_a_camera_that_always_ended_below_full_scale(end_dn: int) -> None:
    brighter = pictures(2, over_black(lambda light: 2.5 * light))
    before, now = (tuple(np.minimum(each, end_dn) for each in taken) for taken in (pictures(1), brighter))
    assert (now[0] == end_dn).mean() > 0.02
    assert "saturates below" not in alteration(before, now, SENSOR)  # type: ignore[arg-type]
    assert ends_early(now[0], SENSOR) == ""


def test_twelve_bits_delivered_as_ten_end_early() -> None:
    white = np.minimum(8 * pictures(1)[0].astype(np.uint32), int(SENSOR.full_scale_dn)) >> 2
    assert "has more than 1023 DN" in ends_early(white.astype(np.uint16), SENSOR)


def test_neither_black_nor_a_sound_white_ends_early() -> None:
    white, black, code = pictures(1)
    assert [ends_early(each, SENSOR) for each in (white, black, code)] == ["", "", ""]


@pytest.mark.parametrize(("light_dn", "most_dn", "is_told"), [(80, 255, False), (160, 127, True)])
def test_a_flat_white_of_few_values_is_cut_off_only_where_they_pile_up(
    light_dn: float, most_dn: int, is_told: bool
) -> None:
    sensor = Sensor(bit_depth=8, black_level_dn=4, electrons_per_dn=200, read_noise_dn=0.3)
    rng = np.random.default_rng(1)

    def flat(light_dn: float) -> NDArray[np.uint16]:
        sigma = np.sqrt(sensor.read_noise_dn**2 + light_dn / sensor.electrons_per_dn)
        counts = np.rint(sensor.black_level_dn + light_dn + rng.normal(0, sigma, (64, 96)))
        return counts.clip(0, sensor.full_scale_dn).astype(np.uint16)

    # One pixel in a hundred and more has the largest value, cut off or not.
    white = np.minimum(flat(light_dn), most_dn)
    said = alteration((flat(160), flat(0), flat(80)), (white, flat(0), flat(40)), sensor)
    assert ["saturates below" in each for each in (said, ends_early(white, sensor))] == [is_told] * 2
