"""Rows that stand for a picture: of any height, all colours are among them."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.optics.spread_rows import spread_rows


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
