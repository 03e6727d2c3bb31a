"""A picture of a line that is unlike its neighbours is doubted, and a second one tells whether rightly."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.neighbours import LineNeighbours
from dsl_core.capture.proof.raster import Counts, Noise
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
