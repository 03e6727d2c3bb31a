"""Neighbours tell a peak that is out of focus from two surfaces in one pixel."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.reconstruction.columns import two_surfaces

ROWS, COLUMNS = 7, 9


def two_surfaces_std_px(column_px: np.ndarray, unusual: np.ndarray) -> np.ndarray:
    """Of unusual peaks alone, with little noise."""
    std_px = np.full(column_px.shape, 0.01)
    return two_surfaces.two_surfaces_std_px(column_px, std_px, unusual, np.zeros(column_px.shape, bool))


def plane() -> np.ndarray:
    y, x = np.mgrid[:ROWS, :COLUMNS]
    return np.asarray(100.0 + 2.9 * x - 0.4 * y)


def only(y: int, x: int) -> np.ndarray:
    unusual = np.zeros((ROWS, COLUMNS), bool)
    unusual[y, x] = True
    return unusual


def test_where_a_surface_goes_on_smoothly_nothing_is_doubted() -> None:
    rough = plane() + np.random.default_rng(0).normal(0, 0.01, (ROWS, COLUMNS))
    assert not two_surfaces_std_px(rough, np.ones((ROWS, COLUMNS), bool))[2:-2, 2:-2].any()
    bent = plane() + 0.02 * np.arange(COLUMNS) ** 2
    assert not two_surfaces_std_px(bent, only(3, 4)).any()


@pytest.mark.parametrize("turned", [False, True])
def test_a_jump_leaves_half_of_it_open(turned: bool) -> None:
    seen = plane()
    seen[:, 5:] += 3.0
    seen[:, 4] += 1.5
    unusual = only(3, 4)
    found = (
        two_surfaces_std_px(seen[:, 1:8].T, unusual[:, 1:8].T).T
        if turned
        else two_surfaces_std_px(seen[:, 1:8], unusual[:, 1:8])
    )
    assert found[3, 3] == pytest.approx((3.0 - 0.25) / 2)
    assert np.count_nonzero(found) == 1, "other pixels are as sure as before"


def test_beside_shadow_and_at_the_edge_of_the_picture_a_whole_column_is_open() -> None:
    seen = plane()
    seen[3, 6] = np.nan
    assert two_surfaces_std_px(seen, only(3, 4))[3, 4] == 1.0
    assert two_surfaces_std_px(seen, only(0, 3))[0, 3] == 1.0
    assert (
        two_surfaces_std_px(seen, np.zeros((ROWS, COLUMNS), bool)).tolist() == np.zeros(seen.shape).tolist()
    )


def test_without_a_peak_the_column_of_either_surface_is_open() -> None:
    seen, none = plane(), np.zeros((ROWS, COLUMNS), bool)
    seen[:, 5:] += 9.0
    seen[:, 4] += 9.0
    noise = np.full(seen.shape, 0.05)
    found = two_surfaces.two_surfaces_std_px(seen, noise, none, only(3, 4))
    assert found[3, 4] == pytest.approx((9.0 - 0.25) * 3**-0.5)
    assert np.count_nonzero(found) == 1
    # Noise may leave as much between neighbours, and beside shadow nothing is known.
    assert not two_surfaces.two_surfaces_std_px(seen, 20 * noise, none, only(3, 4)).any()
    seen[3, 6] = np.nan
    assert not two_surfaces.two_surfaces_std_px(seen, noise, none, only(0, 3)).any()
