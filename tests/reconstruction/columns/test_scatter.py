"""Columns of neighbours that scatter by more than their deviations say, and surfaces that only look so."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.reconstruction.columns.scatter import scatter_of

SHAPE = (48, 64)
STD_PX = np.full(SHAPE, 0.02)
EVERYWHERE = np.ones(SHAPE, bool)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
#: Columns of a surface that is curved as a small ball is.
BALL = 3.2 * X + 0.1 * Y + 0.01 * (X - 30) ** 2


def noise(scale: float) -> np.ndarray:
    return scale * np.random.default_rng(1).standard_normal(SHAPE)


def test_columns_that_scatter_as_stated_lack_nothing() -> None:
    assert scatter_of(BALL + noise(0.02), STD_PX, EVERYWHERE) is None
    assert scatter_of(BALL + noise(0.005), STD_PX, EVERYWHERE) is None


@pytest.mark.parametrize("texture", [(X + Y) % 2 - 0.5, X % 2 - 0.5, Y % 2 - 0.5])
def test_a_texture_finer_than_pixels_is_what_deviations_lack_where_it_is(texture: np.ndarray) -> None:
    left = SHAPE[1] // 2 > X
    found = scatter_of(BALL + noise(0.02) + 0.4 * left * texture, STD_PX, EVERYWHERE)
    assert found is not None
    inside = SHAPE[1] // 2 - 2 > X
    assert (found.ratio[inside] > 5).all()
    assert (found.error_px[inside] > 0.15).all()
    assert (found.ratio[SHAPE[1] // 2 + 2 < X] == 1).all()
    assert (found.error_px[SHAPE[1] // 2 + 2 < X] == 0).all()


def test_errors_that_alternate_with_the_place_between_lines_are_no_texture() -> None:
    # Lines every 5 columns and 2.4 columns a pixel: the error jumps where a line is as near as the next.
    column = 2.4 * Y + 0.01 * X
    error = 0.16 * (np.mod(column, 5) / 5 - 0.5)
    stated = np.full(SHAPE, 0.8 * float(error.std()))
    assert scatter_of(column + error + noise(0.01), stated, EVERYWHERE) is None


def test_a_few_edges_and_what_is_not_asked_say_nothing_of_the_rest() -> None:
    jumps = BALL + noise(0.02) + 5.0 * (X > 40) + 3.0 * (Y > 30)
    assert scatter_of(jumps, STD_PX, EVERYWHERE) is None
    rough = BALL + noise(0.3)
    assert scatter_of(rough, STD_PX, EVERYWHERE) is not None
    assert scatter_of(rough, STD_PX, (X % 3 > 0) & (Y % 3 > 0)) is None, "no five neighbours"
