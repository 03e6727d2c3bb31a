"""How live frames are shown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.display import PLAIN, Display, Tone, display_tables
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
