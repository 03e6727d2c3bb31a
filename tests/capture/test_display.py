"""How live frames are shown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.display import FIRST, PLAIN, Display, Tone, display_tables
from dsl_core.capture.preview import quick_picture

FULL = 4095


def _channels(red: int, green: int, blue: int) -> list[NDArray[np.uint16]]:
    """A ramp up to a level in each channel."""
    ramp = np.linspace(0, 1, 64 * 64).reshape(64, 64)
    return [np.round(ramp * level).astype(np.uint16) for level in (red, green, blue)]


def test_plain_tables_are_the_square_root_of_the_counts() -> None:
    (table, *others) = display_tables(PLAIN, _channels(4000, 4000, 4000), FULL)
    assert (table[0], table[1024], table[FULL]) == (0, 128, 255)
    assert all((each == table).all() for each in others)


def test_a_dim_and_reddish_scene_is_first_seen_bright_and_grey() -> None:
    channels = _channels(300, 200, 150)
    tables = display_tables(FIRST, channels, FULL)
    shown = [int(table[level]) for table, level in zip(tables, (300, 200, 150), strict=True)]
    assert min(shown) > 200
    assert max(shown) - min(shown) <= 2


def test_a_first_order_of_a_thousandth_is_seen_when_logarithmic() -> None:
    levels = {tone: display_tables(Display(tone), _channels(4000, 4000, 4000), FULL)[1] for tone in Tone}
    assert levels[Tone.LINEAR][8] == 0
    assert levels[Tone.ROOT][8] < 15
    assert levels[Tone.LOG][8] > 35
    assert all(table[FULL] == 255 for table in levels.values())


def test_a_stretch_spans_what_is_there_and_not_noise() -> None:
    table = display_tables(Display(Tone.LINEAR, stretch=True), _channels(200, 400, 300), FULL)[0]
    assert table[0] == 0
    assert table[400] == 255
    assert 110 < table[200] < 140
    table = display_tables(Display(Tone.LINEAR, stretch=True), _channels(3, 3, 3), FULL)[0]
    assert table[3] < 60


def test_gain_brightens_and_white_balance_greys() -> None:
    channels = _channels(1000, 2000, 500)
    tables = display_tables(Display(Tone.LINEAR, gain=2.0, balance=True), channels, FULL)
    shown = [int(table[level]) for table, level in zip(tables, (1000, 2000, 500), strict=True)]
    assert max(shown) - min(shown) <= 2
    assert 120 < shown[0] < 130
    only_red = display_tables(Display(balance=True), _channels(4000, 0, 0), FULL)
    assert only_red[1][0] == 0


def test_the_picture_uses_the_tables() -> None:
    mosaic = np.full((8, 8), 40, np.uint16)
    plain, bright = (quick_picture(mosaic, "RGGB", FULL, display=each) for each in (PLAIN, Display(gain=4)))
    assert (plain == quick_picture(mosaic, "RGGB", FULL)).all()
    assert bright.mean() > 1.9 * plain.mean()


def _levelled(*levels: int) -> list[NDArray[np.uint16]]:
    return [np.full((8, 8), level, np.uint16) for level in levels]


def test_a_stretch_spans_half_a_percent_to_all_but_a_fifth_of_a_percent() -> None:
    thin = np.arange(0, 4000, 4, dtype=np.uint16).reshape(100, 10)
    full = np.zeros((400, 40), np.uint16)
    full[1::4], full[:, 1::4] = FULL, FULL
    full[::4, ::4] = thin
    low, high = (float(np.percentile(thin, share)) for share in (0.5, 99.8))
    table = display_tables(Display(Tone.LINEAR, stretch=True), [full, full, full], FULL)[0]
    counts = np.arange(FULL + 1)
    assert len(table) == FULL + 1
    np.testing.assert_array_equal(table, np.round(255 * ((counts - low) / (high - low)).clip(0, 1)))


def test_a_stretch_is_sixteen_counts_at_least() -> None:
    table = display_tables(Display(Tone.LINEAR, stretch=True), _levelled(100, 100, 100), FULL)[0]
    assert table[100:117].tolist() == np.round(255 * np.arange(17) / 16).tolist()


def test_a_logarithmic_tone_reaches_down_to_a_thousandth() -> None:
    table = display_tables(Display(Tone.LOG), _levelled(1, 1, 1), FULL)[0]
    assert table[41] == round(255 * np.log1p(1000 * 41 / FULL) / np.log1p(1000))


def test_white_balance_makes_means_above_black_equal_where_there_is_white() -> None:
    def shown(levels: tuple[int, int, int], at: tuple[int, int, int], **how: bool) -> list[int]:
        tables = display_tables(Display(Tone.LINEAR, balance=True, **how), _levelled(*levels), FULL)
        return [int(table[count]) for table, count in zip(tables, at, strict=True)]

    assert shown((1000, 2000, 500), (1000, 2000, 500)) == [62, 62, 62]
    # Up to a factor of five; light of one colour keeps it.
    assert shown((400, 1000, 2000), (400, 1000, 2000)) == [62, 62, 62]
    assert shown((399, 1000, 2000), (399, 1000, 2000)) == [25, 62, 125]
    assert shown((300, 300, 3600), (300, 300, 3600)) == [19, 19, 224]
    # A channel at black, and one with no pixel below saturation, is one count bright.
    assert shown((0, 1, 3), (1000, 1000, 1000)) == [62, 62, 21]
    assert shown((FULL, 200, 300), (100, 100, 100)) == [6, 6, 6]


def test_what_a_stretch_puts_at_black_does_not_count_for_white() -> None:
    channels = [200 + values for values in _channels(1000, 2000, 500)]
    tables = display_tables(Display(Tone.LINEAR, stretch=True, balance=True), channels, FULL)
    shown = [int(table[count]) for table, count in zip(tables, (700, 1200, 450), strict=True)]
    assert max(shown) - min(shown) <= 2
