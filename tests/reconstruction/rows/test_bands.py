"""Bands of rows cover a picture once, fit into memory, and bring the neighbours of their pixels."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, GrayCode, NoSpectral, ScanLines
from dsl_core.reconstruction.rows.bands import Band, PixelsOf, RowsOf, all_rows, bands_of, some_rows

PLAN = CapturePlan(camera_size_px=(890, 580), code=GrayCode(rows=False), spectral=ScanLines())


def test_a_band_has_four_rows_beside_it_on_either_side() -> None:
    bands = bands_of(PLAN, rows=200)
    assert [(band.rows.start, band.rows.stop) for band in bands] == [(0, 192), (192, 384), (384, 580)]
    assert [(band.near.start, band.near.stop) for band in bands] == [(0, 196), (188, 388), (380, 580)]
    assert [(band.own.start, band.own.stop) for band in bands] == [(0, 192), (4, 196), (4, 200)]


@pytest.mark.parametrize(
    ("rows", "multiple", "starts"),
    [
        (580, 2, [0]), (579, 2, [0, 290]), (9, None, [0]), (130, 64, [0, 128, 256, 384, 512]),
        # Four rows more in the last one, where they fit.
        (196, 64, [0, 192, 384]), (195, 64, [0, 192, 384, 576]),
        (68, 64, [0, 64, 128, 192, 256, 320, 384, 448, 512]),
        (67, 64, [0, 64, 128, 192, 256, 320, 384, 448, 512, 576]),
        (1, 64, [0, 64, 128, 192, 256, 320, 384, 448, 512, 576]),
    ],
)  # fmt: skip
def test_bands_are_whole_numbers_of_what_is_worked_on_together(
    rows: int, multiple: int | None, starts: list[int]
) -> None:
    bands = bands_of(PLAN, rows, multiple)
    assert [band.rows.start for band in bands] == starts
    assert bands[-1].rows.stop == 580


def test_bands_are_no_higher_than_fits_and_alike_but_for_the_last() -> None:
    for height, fit, multiple in itertools.product(
        (1, 9, 10, 63, 130, 299), (1, 5, 64, 100, 200), (1, 2, 64)
    ):
        plan = PLAN.model_copy(update={"camera_size_px": (8, height)})
        heights = [band.rows.stop - band.rows.start for band in bands_of(plan, fit, multiple)]
        assert sum(heights) == height
        assert min(heights) > 0
        assert max(heights) <= max(fit, multiple)
        assert len(set(heights[:-1])) <= 1
        assert all(each % multiple == 0 for each in heights[:-1])


def test_memory_decides_how_high_bands_are() -> None:
    # 890 columns of 318 frames in six bytes: 320 MiB hold 197 rows, of which eight are neighbours.
    assert PLAN.spectral_count == 318
    fit = (320 << 20) // (890 * 6 * 318) - 8
    assert fit == 189
    assert [band.rows.start for band in bands_of(PLAN)] == [0, 144, 288, 432]
    # At least as if 64 frames were held: 973 rows.
    few = PLAN.model_copy(update={"spectral": NoSpectral()})
    assert len(bands_of(few.model_copy(update={"camera_size_px": (890, 973)}))) == 1
    assert len(bands_of(few.model_copy(update={"camera_size_px": (890, 974)}))) == 2


@dataclass(frozen=True)
class Maps:
    """A record of maps, one of which is missing."""

    one: NDArray[np.float64]
    cube: NDArray[np.float64]
    none: NDArray[np.float64] | None = None


def test_records_are_cut_into_rows_and_put_together_again() -> None:
    whole = Maps(np.arange(20.0).reshape(5, 4), np.arange(60.0).reshape(3, 5, 4))
    parts = [some_rows(whole, slice(0, 2)), some_rows(whole, slice(2, 5))]
    assert parts[1].one[0, 0] == 8.0
    assert parts[1].cube.shape == (3, 3, 4)
    again = all_rows(parts)
    np.testing.assert_array_equal(again.one, whole.one)
    np.testing.assert_array_equal(again.cube, whole.cube)
    assert again.none is None
    assert all_rows(parts[:1]) is parts[0]


class Source:
    """Frames whose pixels are numbered."""

    plan = PLAN

    def read(self, shot: Any) -> NDArray[np.uint16]:
        return np.arange(24, dtype=np.uint16).reshape(4, 6) + np.uint16(100 * shot)


def test_some_rows_or_pixels_of_a_scan_are_read() -> None:
    source: Any = Source()
    shot: Any = 1
    assert RowsOf(source, slice(1, 3)).read(shot).tolist() == source.read(1)[1:3].tolist()
    assert RowsOf(source, np.array([0, 3])).read(shot).tolist() == source.read(1)[[0, 3]].tolist()
    assert PixelsOf(source, np.array([7, 2, 23])).read(shot).tolist() == [[107, 102, 123]]
    assert RowsOf(source, slice(1, 3)).plan is PixelsOf(source, np.array([1])).plan is PLAN
    assert Band(slice(4, 8), slice(0, 12)).own == slice(4, 8)
