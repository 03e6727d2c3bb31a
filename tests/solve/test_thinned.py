"""Some of many pixels show every colour of a mosaic, however wide the picture."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.solve.thinned import thinned


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
