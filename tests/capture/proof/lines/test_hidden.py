"""Nothing but something in the way makes a part of a line darker than black."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.lines.hidden import HiddenParts
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.rig import Sensor

NOISE, LEVEL = Noise.of(Sensor(), 12), Sensor().black_level_dn
WIDTH, PIXELS = 50, 2000


def picture(seed: int, line: int = -1, hidden: int = 0, room_dn: float = 60.0, share: float = 0.3) -> Counts:
    """A line among forty rows, with so many columns hidden, to which a share of the room's light is left."""
    light = np.full((PIXELS // WIDTH, WIDTH), room_dn)
    light[:, :hidden] *= share
    if line >= 0:
        light[:, line] += 300
    counts = np.rint(LEVEL + light + np.random.default_rng(seed).normal(0, 3, light.shape))
    return counts.clip(0).astype(np.uint16).ravel()


BLACK = picture(0)


def hides(*pictures: Counts, black: Counts = BLACK) -> list[bool]:
    parts = HiddenParts(NOISE)
    return [parts.is_hidden(0, seen, black) for seen in pictures]


@pytest.mark.parametrize(
    ("hidden", "share", "is_told"), [(12, 0.3, True), (2, 0.3, True), (0, 0.3, False), (12, 0.8, False)]
)
def test_somebody_who_walks_by_is_told_for_as_long_as_they_are_there(
    hidden: int, share: float, is_told: bool
) -> None:
    passing = [picture(2 + at, 20 + at, hidden, share=share) for at in range(3)]
    assert hides(picture(1, 20), *passing, picture(9, 30)) == [False, *3 * [is_told], False]


def test_a_shadow_with_soft_edges_over_half_of_the_picture_is_not_taken_for_noise() -> None:
    seen = picture(2, 21).reshape(-1, WIDTH) - LEVEL
    left = 1 - 0.65 * np.exp(-(((np.arange(WIDTH) / WIDTH - 0.5) / 0.3) ** 2))
    shaded = np.rint(LEVEL + left * seen).astype(np.uint16).ravel()
    assert hides(picture(1, 20), shaded) == [False, True]


@pytest.mark.parametrize(
    ("gains", "colours"),
    [((0.4, 1.0, 1.0), (0,)), ((0.4, 1.0, 0.4), (0, 2)), ((0.4, 0.4, 0.4), ()), ((1.0, 1.0, 1.0), ())],
)
def test_colours_that_alone_are_dark_are_hidden_by_nobody(
    gains: tuple[float, float, float], colours: tuple[int, ...]
) -> None:
    cells = np.array([[0, 1], [1, 2]], np.int8)
    channels = np.tile(cells, (PIXELS // WIDTH // 2, WIDTH // 2)).ravel()
    seen = LEVEL + (picture(1, 20) - LEVEL) * np.array(gains)[channels]
    counts = np.rint(np.where(np.arange(PIXELS) % WIDTH < 25, seen, picture(1, 20))).astype(np.uint16)
    assert HiddenParts(NOISE).colours(counts, BLACK, channels, WIDTH) == colours


def test_a_colour_that_has_no_light_where_something_stands_says_nothing() -> None:
    cells = np.array([[0, 1], [1, 2]], np.int8)
    channels = np.tile(cells, (PIXELS // WIDTH // 2, WIDTH // 2)).ravel()
    left = np.arange(PIXELS) % WIDTH < 15
    room = np.where(left & (channels == 0), 5.0, 60.0)
    rng = np.random.default_rng(5)
    black, seen = (
        np.rint(LEVEL + each + rng.normal(0, 3, PIXELS)).astype(np.uint16)
        for each in (room, np.where(left, 0.2 * room, room))
    )
    assert HiddenParts(NOISE).colours(seen, black, channels, WIDTH) == ()


def test_a_darker_room_hides_nothing() -> None:
    assert hides(picture(1, 20), picture(2, 21, room_dn=20.0), picture(3, 22)) == 3 * [False]


def test_black_that_was_too_bright_itself_is_left_to_those_who_judge_black() -> None:
    bright = np.where(np.arange(PIXELS) % WIDTH < 12, BLACK + 60, BLACK).astype(np.uint16)
    assert hides(picture(1, 20), picture(2, 21), black=bright) == [False, False]


def test_lines_of_another_setting_begin_anew() -> None:
    parts = HiddenParts(NOISE)
    assert not parts.is_hidden(0, picture(1, 20), BLACK)
    assert not parts.is_hidden(1, picture(2, 21, 12), BLACK)
    assert not parts.is_hidden(1, picture(3, 22, 12), BLACK)


def test_a_third_of_a_bright_room_may_go_before_something_is_in_its_way() -> None:
    black = picture(0, room_dn=600.0)
    for share, is_told in ((0.7, False), (0.6, True)):
        assert hides(picture(1, 20, room_dn=600.0), picture(2, 21, 12, 600.0, share), black=black) == [
            False,
            is_told,
        ]
