"""A picture of a line that is unlike its neighbours is doubted, and a second one tells whether rightly."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from dsl_core.capture.proof.lines.neighbours import LineNeighbours
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.rig import Sensor

ROWS, COLUMNS = 24, 64
SENSOR = Sensor(black_level_dn=100.0, read_noise_dn=3.0)


def _picture(line: float, seed: int, light: float = 600.0) -> Counts:
    """A line four pixels wide, slanted, with noise."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    bright = 100 + light * np.exp(-(((columns - line - rows / 8) / 2.0) ** 2))
    noise = np.random.default_rng(seed).normal(0, np.sqrt(9 + (bright - 100) / SENSOR.electrons_per_dn))
    return np.asarray((bright + noise).round().clip(0, 4095), np.uint16).ravel()


BLACK = _picture(0.0, 99, 0.0)


def _told(count: int = 8) -> LineNeighbours:
    neighbours = LineNeighbours(Noise(SENSOR), COLUMNS)
    for index in range(count):
        assert not neighbours.is_doubtful(index, _picture(4.0 * index, index), BLACK)
    return neighbours


def test_usual_pictures_are_not_doubted() -> None:
    _told(12)


@pytest.mark.parametrize("what", ["late", "torn", "dark", "half"])
def test_unusual_ones_are(what: str) -> None:
    neighbours, usual, late = _told(), _picture(32.0, 50), _picture(28.0, 51)
    cut = 7 * usual.size // 10
    picture = {
        "late": late,
        "torn": np.concatenate([usual[:cut], late[cut:]]),
        "dark": _picture(32.0, 52, 0.0),
        "half": _picture(32.0, 53, 300.0),
    }[what]
    assert neighbours.is_doubtful(8, picture, BLACK)
    assert neighbours.differ(picture, usual) or what == "half"
    assert not neighbours.differ(usual, _picture(32.0, 54))


def test_where_pictures_hardly_differ_nothing_is_doubted() -> None:
    neighbours = LineNeighbours(Noise(SENSOR), COLUMNS)
    for index in range(12):
        assert not neighbours.is_doubtful(index, _picture(0.0, index, 3.0), BLACK)


def test_only_pictures_right_after_each_other_are_compared() -> None:
    neighbours = _told()
    assert not neighbours.is_doubtful(20, _picture(28.0, 60), BLACK)
    assert not neighbours.is_doubtful(21, _picture(28.0, 61), BLACK)


@pytest.mark.parametrize(("darker", "is_doubtful"), [(6, True), (1, False)])
def test_a_picture_darker_than_black_is_doubted_until_that_is_usual(darker: int, is_doubtful: bool) -> None:
    neighbours = LineNeighbours(Noise(SENSOR), COLUMNS)
    for index in range(4):
        assert not neighbours.is_doubtful(index, flat(120), flat(120))
    # Two sums of 1,536 counts with a variance of 12 each differ by 192; 25 times that are 3.1 a pixel.
    for index in range(4, 7):
        assert neighbours.is_doubtful(index, flat(120 - darker), flat(120)) == is_doubtful
    assert not neighbours.is_doubtful(7, flat(120 - darker), flat(120))


def flat(value: int, lines: int = 0) -> Counts:
    """A picture without noise, of which so many columns are a thousand counts brighter."""
    picture = np.full((ROWS, COLUMNS), value, np.uint16)
    picture[:, :lines] += 1000
    return picture.ravel()


def told_by(*changes: float) -> LineNeighbours:
    """What is usual when pictures changed by so much in all parts of their height."""
    neighbours = LineNeighbours(Noise(SENSOR), COLUMNS)
    neighbours._changes.extend(np.full(4, each) for each in changes)
    neighbours._before = (7, flat(100))
    return neighbours


@pytest.mark.parametrize(
    ("usual", "change", "is_doubtful"),
    [(2.0, 0.61, False), (2.0, 0.59, True), (0.41, 0.1, True), (0.39, 0.1, False)],
)
def test_a_change_by_less_than_three_tenths_of_the_usual_is_doubted_where_that_says_something(
    usual: float, change: float, is_doubtful: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(LineNeighbours, "change", lambda *_: np.array([9.0, change, 9.0, 9.0]))
    assert told_by(usual, usual, usual).is_doubtful(8, flat(100), None) == is_doubtful
    assert not told_by(usual, usual).is_doubtful(8, flat(100), None), "two lines say nothing"


@pytest.mark.parametrize(
    ("usual", "change", "is_doubtful"),
    [(2.0, 0.21, False), (2.0, 0.19, True), (1.01, 0.05, True), (0.99, 0.05, False)],
)
def test_a_fine_part_is_doubted_where_next_to_nothing_changed_and_much_usually_does(
    usual: float, change: float, is_doubtful: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes = np.full(20, 9.0)
    changes[12] = change
    monkeypatch.setattr(LineNeighbours, "change", lambda *_: changes)
    neighbours = told_by(*3 * [usual])
    neighbours._changes = deque(np.full(20, usual) for _ in range(3))
    assert neighbours.is_doubtful(8, flat(100), None) == is_doubtful


def test_a_fine_part_that_some_lines_share_with_the_one_before_is_not_doubted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    changes = np.full(20, 9.0)
    changes[12] = 0.1
    monkeypatch.setattr(LineNeighbours, "change", lambda *_: changes)
    neighbours = told_by(*3 * [2.0])
    neighbours._changes = deque([changes, *(np.full(20, 9.0) for _ in range(4))])
    assert not neighbours.is_doubtful(8, flat(100), None)


def test_an_eighth_of_a_line_that_shows_the_one_before_is_doubted() -> None:
    neighbours, usual, late = _told(), _picture(32.0, 50), _picture(28.0, 51)
    banded, rows = usual.copy(), slice(10 * COLUMNS, 13 * COLUMNS)
    banded[rows] = late[rows]
    assert neighbours.is_doubtful(8, banded, BLACK)
    assert neighbours.differ(banded, usual)


@pytest.mark.parametrize(
    ("usual", "change", "differs"),
    [(2.0, 1.1, True), (2.0, 0.9, False), (0.5, 0.39, False), (0.39, 9.0, False)],
)
def test_two_pictures_of_a_shot_differ_by_half_of_the_usual_change(
    usual: float, change: float, differs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(LineNeighbours, "change", lambda *_: np.array([0.0, 0.0, 0.0, change]))
    assert told_by(usual, usual, usual).differ(flat(100), flat(100)) == differs


def test_a_change_is_the_variance_beyond_noise_in_each_part_of_the_height_up_to_ten_deviations() -> None:
    neighbours = LineNeighbours(Noise(SENSOR), COLUMNS)
    one, other = flat(100).reshape(ROWS, COLUMNS), flat(100).reshape(ROWS, COLUMNS).copy()
    # The variance of a count without light is 9.1, of two 18.2.
    other[:6] -= 6
    other[6:12, ::2] = 3000
    found = neighbours.change(one.ravel(), other.ravel())
    assert found[:4] == pytest.approx([36 / 18.2 - 1, 100 / 2 - 1, -1, -1], rel=1e-4)
    # Sixteen parts of 24 rows are one row and two in turn.
    assert found[4:] == pytest.approx(np.repeat(found[:4], 4), rel=1e-4)
    few = neighbours.change(one[:5].ravel(), other[:5].ravel())
    assert few == pytest.approx(np.full(4 + 5, 36 / 18.2 - 1), rel=1e-4), "no more fine parts than rows"


@pytest.mark.parametrize(("light", "is_other"), [(0.61, False), (0.59, True), (1.59, False), (1.61, True)])
def test_light_is_other_below_six_tenths_and_above_sixteen_of_the_usual(light: float, is_other: bool) -> None:
    neighbours, black = LineNeighbours(Noise(SENSOR), COLUMNS), flat(100)
    for _ in range(3):
        assert not neighbours._has_other_light(flat(200), black)
    assert neighbours._has_other_light(flat(100 + round(100 * light)), black) == is_other
    assert not neighbours._has_other_light(flat(0), None), "nobody knows how dark it should be"


@pytest.mark.parametrize(("above", "counts"), [(1.02, True), (0.98, False)])
def test_light_counts_from_twenty_five_deviations_of_two_blacks_on(above: float, counts: bool) -> None:
    neighbours, black = LineNeighbours(Noise(SENSOR), COLUMNS), flat(100)
    least = 25 * np.sqrt(2 * 9.1 * ROWS * COLUMNS) * above
    picture = flat(100).astype(np.int64)
    picture[: int(least) // 3] += 3
    for _ in range(3):
        neighbours._has_other_light(picture.astype(np.uint16), black)
    assert neighbours._has_other_light(black, black) == counts


def test_two_pictures_of_one_line_are_different_by_all_their_light_or_by_a_few_pixels() -> None:
    rng = np.random.default_rng(3)
    neighbours = LineNeighbours(Noise.of(Sensor(), 12), 40)
    assert neighbours.are_few

    def picture(light: float, room: float = 300.0, lit: int = 200) -> np.ndarray:
        level = np.full(2000, room)
        level[:lit] += light
        return np.rint(level + rng.normal(0, 2.5, level.size)).astype(np.uint16)

    line, black = picture(40), picture(0)
    assert not neighbours.differ_at_first(line, picture(40), black)
    assert not neighbours.differ_at_first(line, picture(40, room=330.0), black), "light of the room"
    assert neighbours.differ_at_first(line, picture(20), black)
    assert neighbours.differ_at_first(picture(400, lit=20), picture(0, lit=20), black)
    assert neighbours.differ_at_first(picture(400, lit=200), picture(280, lit=200), black)
    assert not neighbours.differ_at_first(picture(400, lit=200), picture(350, lit=200), black), "flicker"
    elsewhere = np.roll(picture(40, lit=100), 100)
    assert neighbours.differ_at_first(picture(40, lit=100), elsewhere, black), "another line"


def test_two_smooth_patterns_that_differ_in_every_pixel_are_different() -> None:
    rng = np.random.default_rng(3)
    neighbours = LineNeighbours(Noise.of(Sensor(), 12), 40)
    at = np.arange(2000) * 2 * np.pi / 25

    def picture(phase: float, light: float = 400.0) -> np.ndarray:
        level = 300 + light * (1 + np.cos(at + phase))
        return np.rint(level + rng.normal(0, 2.5, level.size)).astype(np.uint16)

    black = picture(0, light=0)
    assert not neighbours.differ_at_first(picture(0), picture(0), black)
    assert neighbours.differ_at_first(picture(0), picture(np.pi / 6), black)


def test_the_first_lines_are_few_until_one_was_held_against_three_changes() -> None:
    neighbours = LineNeighbours(Noise(SENSOR), COLUMNS)
    few = []
    for index in range(6):
        neighbours.is_doubtful(index, _picture(4.0 * index, index, 60.0), None)
        few.append(neighbours.are_few)
    assert few == [True, True, True, True, False, False]


def test_whole_counts_do_not_make_two_pictures_of_a_faint_line_different() -> None:
    rng = np.random.default_rng(4)
    neighbours = LineNeighbours(Noise.of(Sensor(), 12), 64)

    def picture(light: float) -> np.ndarray:
        level = np.full(3072, 261.0)
        level[:256] += light
        return np.rint(level + rng.normal(0, 2.6, level.size)).astype(np.uint16)

    black = picture(0)
    assert not any(neighbours.differ_at_first(picture(10), picture(10), black) for _ in range(200))


def test_two_pictures_of_a_faint_line_do_not_differ_by_light_of_the_room() -> None:
    neighbours = LineNeighbours(Noise(SENSOR), COLUMNS)
    for index in range(8):
        neighbours.is_doubtful(index, _picture(4.0 * index, index, 60.0), None)
    usual, again = _picture(32.0, 50, 60.0), _picture(32.0, 51, 60.0)
    assert not neighbours.differ(usual, np.asarray(again + 12, np.uint16))
    assert neighbours.differ(usual, np.asarray(_picture(28.0, 52, 60.0) + 12, np.uint16))
