"""Codes of which a part is shown displaced name some columns never and others twice as often."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.plan import BinaryCode, EnsembleCode, GrayCode, XorCode
from dsl_core.patterns.binary_code import binary_image, decoder_of
from dsl_core.patterns.displaced_code import MOST_COLUMNS, DisplacedCode, displaced_code
from dsl_core.patterns.gray_code import bit_counts

SIZE_PX = (640, 36)
GRAY = GrayCode(rows=False)


def seen(
    columns: int,
    since_pair: int,
    code: BinaryCode = GRAY,
    camera_px: int = 890,
    rows: int = 24,
    lean_px: float = 7.3,
) -> NDArray[np.int32]:
    """Columns (rows, camera_px) that a code names on a plane that leans, displaced since one of its pairs."""
    lean = np.linspace(0, lean_px, rows)[:, None]
    at = (np.arange(camera_px) * (590 / camera_px) + 18 + lean).astype(int)
    decoder = decoder_of(code, SIZE_PX)
    for pair in range(sum(bit_counts(code, SIZE_PX)) * (2 if code.kind == "ensemble" else 1)):
        line = binary_image(code, SIZE_PX, 2 * pair)[0] > 0
        light = np.roll(line, columns if pair >= since_pair else 0)[at]
        decoder.add(light, ~light)
    return decoder.finish().column


@pytest.mark.parametrize("code", [GRAY, GrayCode(), XorCode(rows=False), EnsembleCode(rows=False)])
def test_a_code_in_its_place_is_not_displaced(code: BinaryCode) -> None:
    assert displaced_code(code, SIZE_PX, seen(0, 0, code)) is None


@pytest.mark.parametrize("columns", [-2, -1, 1, 2])
def test_a_displacement_is_found_with_the_pair_since_which_it_is(columns: int) -> None:
    assert [displaced_code(GRAY, SIZE_PX, seen(columns, since)) for since in range(1, 9)] == [
        DisplacedCode(columns, since) for since in range(1, 9)
    ]


def test_the_widest_displacement_is_found() -> None:
    assert displaced_code(GRAY, SIZE_PX, seen(MOST_COLUMNS, 3)) == DisplacedCode(MOST_COLUMNS, 3)


def test_a_whole_code_that_is_displaced_is_only_seen_by_its_rows() -> None:
    assert displaced_code(GRAY, SIZE_PX, seen(1, 0)) is None


def test_rows_between_are_no_displacement() -> None:
    assert displaced_code(GrayCode(), SIZE_PX, seen(1, 10, GrayCode())) is None


def test_where_a_picture_skips_columns_several_edges_have_to_agree() -> None:
    assert displaced_code(GRAY, SIZE_PX, seen(1, 1, camera_px=80, rows=400)) is None
    assert displaced_code(GRAY, SIZE_PX, seen(1, 7, camera_px=80, rows=400)) == DisplacedCode(1, 7)


@pytest.mark.parametrize("camera_px", [63, 80, 200, 430, 640, 890, 1300])
@pytest.mark.parametrize("lean_px", [0.0, 2.5, 30.0])
def test_columns_that_no_row_happens_to_see_are_no_displacement(camera_px: int, lean_px: float) -> None:
    assert displaced_code(GRAY, SIZE_PX, seen(0, 0, camera_px=camera_px, rows=36, lean_px=lean_px)) is None


@pytest.mark.parametrize("code", [GRAY, XorCode(rows=False), EnsembleCode(rows=False)])
@pytest.mark.parametrize("apart", [2, 3, 4, 8])
@pytest.mark.parametrize("lean_px", [0.0, 1.0])
def test_pixels_a_whole_number_of_columns_apart_are_no_displacement(
    code: BinaryCode, apart: int, lean_px: float
) -> None:
    column = seen(0, 0, code, camera_px=590, rows=96, lean_px=lean_px)
    for first in range(2):
        assert displaced_code(code, SIZE_PX, column[:, first::apart]) is None


@pytest.mark.parametrize("code", [GRAY, XorCode(rows=False)])
@pytest.mark.parametrize(("columns", "pixels"), [(4, 3), (8, 3), (8, 5), (16, 3)])
def test_columns_that_repeat_every_few_pixels_are_no_displacement(
    code: BinaryCode, columns: int, pixels: int
) -> None:
    apart = columns / pixels
    for first in range(columns):
        at = np.arange(first / pixels + 18, 600, apart) + 1e-6
        column = np.tile(seen(0, 0, code, camera_px=590, rows=1)[0][(at - 18).astype(int)], (96, 1))
        assert displaced_code(code, SIZE_PX, column) is None


def test_a_surface_that_ends_at_the_edge_of_a_stripe_is_no_displacement() -> None:
    column = seen(0, 0)
    assert displaced_code(GRAY, SIZE_PX, np.where((column >= 505) & (column < 512), -1, column)) is None
    assert displaced_code(GRAY, SIZE_PX, np.where(column == 511, -1, column)) is None
    assert displaced_code(GRAY, SIZE_PX, np.where(column == 511, 512, column)) == DisplacedCode(1, 1)


def test_few_pixels_say_nothing() -> None:
    assert displaced_code(GRAY, SIZE_PX, seen(1, 1, rows=8)) is None
    assert displaced_code(GRAY, SIZE_PX, np.full((4, 5), -1)) is None


@pytest.mark.parametrize("width", [2, 3, 16, 17, 31, 64])
def test_narrow_projectors_have_codes_too(width: int) -> None:
    column = np.tile(np.arange(width), (48, 1))
    assert displaced_code(GRAY, (width, 4), column) is None
