"""The line that a picture shows is named by its columns."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.lines.line_shown import line_shown
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.model.plan import Shot

WIDTH_PX = 32
#: Three pixels of each column and LED are located.
KEY = np.repeat(np.arange(3 * WIDTH_PX), 3)
LIT = Lit(
    np.arange(KEY.size),
    KEY,
    np.full(KEY.size, 100, np.float32),
    np.full(KEY.size, 1000, np.float32),
    np.full(KEY.size, 5, np.float32),
)


def line(first: int, light: float = 1.0) -> Floats:
    """Two columns of every eight."""
    columns = light * (np.arange(WIDTH_PX) % 8 // 2 == first)
    return np.repeat(columns, 3).astype(np.float32)


LINES = [(Shot(12 + k, "spectral", k, 0, 10.0, 1.0), line(k)) for k in range(4)]
WHITE = Shot(10, "white", 0, 0, 10.0, 1.0), np.ones(3 * WIDTH_PX, np.float32)
BLACK = Shot(11, "black", 0, 0, 10.0, 1.0), np.zeros(3 * WIDTH_PX, np.float32)
EVERY = [WHITE, BLACK, *LINES]


def seen(profile: Floats) -> Counts:
    return np.asarray(100 + 1000 * profile[KEY], np.uint16)


def test_it_is_the_one_most_like_it() -> None:
    for shot, profile in [WHITE, *LINES]:
        assert line_shown(seen(profile), LIT, EVERY, WIDTH_PX) == shot
    assert line_shown(seen(0.6 * line(1) + 0.4 * line(2)), LIT, EVERY, WIDTH_PX) == LINES[1][0]


@pytest.mark.parametrize(("light", "is_named"), [(0.21, True), (0.19, False), (0.0, False)])
def test_one_that_is_nearly_dark_has_no_name(light: float, is_named: bool) -> None:
    assert (line_shown(seen(line(1, light)), LIT, LINES, WIDTH_PX) is not None) == is_named


def test_a_picture_that_is_like_none_has_no_name() -> None:
    assert line_shown(seen(line(0)), LIT, LINES[1:], WIDTH_PX) is None
    assert line_shown(seen(line(0)), LIT, [], WIDTH_PX) is None
