"""Probed pixels are spread over the picture, and each takes the other colours of its neighbours."""

from __future__ import annotations

import numpy as np

from dsl_core.reconstruction.spectral.probing.probed_pixels import cell_of, sample_pixels, samples_of


def test_chosen_pixels_are_spread_over_all_cells_and_have_whole_neighbourhoods() -> None:
    valid = np.ones((60, 80), bool)
    valid[:, 40] = False
    chosen = sample_pixels(valid, 3)
    rows, columns = np.divmod(chosen, 80)
    assert (np.bincount(cell_of(rows, columns, valid.shape), minlength=48) == 3).all()
    assert not np.isin(columns, (0, 39, 40, 41, 79)).any()
    assert not np.isin(rows, (0, 59)).any()


def test_a_pixel_has_its_own_sample_and_those_of_other_colours_around_it() -> None:
    shape = (6, 8)
    # Red at an even row and column: four green and four blue neighbours; green has as many of each other.
    red, green = 2 * shape[1] + 2, 2 * shape[1] + 3
    samples, owner = samples_of(np.array([red, green]), shape, "RGGB")
    assert sorted(samples[owner == 0]) == [red + dy * 8 + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    assert sorted(samples[owner == 1]) == sorted([green, green - 1, green + 1, green - 8, green + 8])
