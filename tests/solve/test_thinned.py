"""Some of many pixels, or rows, show every colour of a mosaic, however large the picture."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.solve.thinned import spread_rows, thinned


@pytest.mark.parametrize("width", [60, 61])
@pytest.mark.parametrize("about", [1200, 900, 600, 450])
def test_all_sites_of_a_mosaic_are_among_them(width: int, about: int) -> None:
    some = thinned(np.arange(40 * width), about)
    assert about / 2 < len(some) <= 2 * about
    rows, columns = np.divmod(some, width)
    sites = np.bincount(rows % 2 * 2 + columns % 2, minlength=4) / len(some)
    assert sites == pytest.approx(0.25, abs=0.05)


def test_few_stay_as_they_are() -> None:
    assert thinned(np.arange(7), 4).tolist() == list(range(7))


@pytest.mark.parametrize("count", [36, 55, 145])
def test_rows_of_any_height_are_even_and_odd_and_spread_over_it(count: int) -> None:
    for height in (*range(2, 1500), 2048, 3000, 4096):
        rows = spread_rows(height, count)
        assert count - 1 <= rows.size <= count or rows.size == height
        assert 0.2 < np.mean(rows % 2) < 0.8 or height < 5, height
        assert rows[0] == 0
        assert rows[-1] >= height - 2
        assert np.diff(rows).max() <= height / count + 4


def test_heights_whose_even_rows_alone_would_be_spread_evenly_have_both() -> None:
    assert np.linspace(0, 70, 36).round().astype(int).tolist() == list(range(0, 71, 2))
    assert np.bincount(spread_rows(71, 36) % 2).tolist() == [19, 17]
