"""Black that shows a line is brighter than the lines after it, where these leave it dark."""

import numpy as np
import pytest

from dsl_core.capture.proof.lines.bright_black import FIRST, TOGETHER, BrightBlack
from dsl_core.capture.proof.noise import Noise
from dsl_core.model.rig import Sensor

SIZE = 600


def picture(
    rng: np.random.Generator, lit: slice, light_dn: float = 40.0, room_dn: float = 60.0
) -> np.ndarray:
    level = np.full(SIZE, room_dn)
    level[lit] += light_dn
    return np.rint(level + rng.normal(0, 2.5, SIZE)).astype(np.uint16)


def told(black: np.ndarray, lines: list[np.ndarray], watch: BrightBlack | None = None) -> list[int]:
    watch = watch or BrightBlack(Noise.of(Sensor(), 12))
    return [at for at, line in enumerate(lines) if watch.is_told(0, line, black)]


@pytest.fixture
def lines() -> list[np.ndarray]:
    rng = np.random.default_rng(7)
    return [picture(rng, slice(10 * at, 10 * at + 10)) for at in range(1, 41)]


def test_black_that_shows_the_line_before_is_told_once(lines: list[np.ndarray]) -> None:
    rng = np.random.default_rng(8)
    assert told(picture(rng, slice(0, 10)), lines) == [TOGETHER - 1]


def test_black_is_not_told_where_it_is_dark_or_all_of_the_room_became_darker(lines: list[np.ndarray]) -> None:
    rng = np.random.default_rng(9)
    assert told(picture(rng, slice(0, 0)), lines) == []
    assert told(picture(rng, slice(0, 0), room_dn=75.0), lines) == []
    for part in (slice(0, 300), slice(440, 590)):  # a half and a quarter of all pixels
        assert told(picture(rng, part), lines) == []


def test_only_the_first_lines_are_asked(lines: list[np.ndarray]) -> None:
    rng, watch = np.random.default_rng(10), BrightBlack(Noise.of(Sensor(), 12))
    assert told(picture(rng, slice(0, 0)), lines[:FIRST], watch) == []
    assert told(picture(rng, slice(0, 10)), lines, watch) == []
