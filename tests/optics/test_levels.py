"""Levels of pictures, and three bands as colours."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.optics.levels import (
    between,
    natural_bands,
    rgba_of_colours,
    spread_of,
    three_bands,
    top_of,
)


def test_values_between_levels_become_shares_and_what_is_unknown_stays_so() -> None:
    found = between(np.array([0.1, 0.2, 0.3, 0.4, 0.9, np.nan]), (0.2, 0.4))
    np.testing.assert_allclose(found, [0, 0, 0.5, 1, 1, np.nan], atol=1e-6)
    with pytest.raises(StoreError, match=r"0\.4 and 0\.2; the first must be below"):
        between(found, (0.4, 0.2))


def test_three_bands_have_the_same_levels() -> None:
    cube = np.array([0.0, 0.1, 0.2, 0.4])[:, None, None] * np.ones((4, 1, 2), np.float32)
    cube[:, 0, 1] = np.nan
    colours = three_bands(cube, (3, 1, 0), (0.0, 0.2))
    np.testing.assert_allclose(colours[:, 0, 0], [1, 0.5, 0])
    assert rgba_of_colours(colours)[0].tolist() == [[255, 128, 0, 255], [0, 0, 0, 0]]


def test_natural_bands_are_the_nearest_that_there_are() -> None:
    assert natural_bands(np.array([500.0, 549.0, 552.0, 900.0])) == (2, 1, 0)


def test_one_bright_pixel_does_not_darken_all_bands() -> None:
    cube = np.full((6, 20, 50), 0.5, np.float32)
    cube[:, 0, 0] = 40.0
    assert top_of(cube) == pytest.approx(0.5, rel=1e-5)


def test_a_picture_of_which_nothing_is_known_is_shown_from_none_to_all_of_the_light() -> None:
    assert spread_of(np.full((2, 3), np.nan)) == (0.0, 1.0)
