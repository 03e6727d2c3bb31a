"""Spoiled pictures are other pictures, and such that a camera could have taken them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.cases.spoiled_pictures import FULL_DN, SLOW, SPOILED, squared


@pytest.mark.parametrize("kind", SPOILED)
def test_a_spoiled_picture_is_plausible_and_another_one(kind: str) -> None:
    taken = np.random.default_rng(3).integers(200, 4096, (24, 32)).astype(np.uint16)
    _, spoil = SPOILED[kind]
    found = [spoil(taken.copy(), count) for count in (0, SLOW)]
    for spoiled in found:
        assert (spoiled.shape, spoiled.dtype) == (taken.shape, taken.dtype)
        assert spoiled.max() <= FULL_DN
    # Some only show after a while, others have passed by then.
    assert any((spoiled != taken).any() for spoiled in found)


def test_a_squared_pattern_is_narrower_further_down() -> None:
    stripes = np.repeat(np.arange(100, dtype=np.uint8)[None], 50, 0)
    found = squared(stripes)
    assert (found[0] == stripes[0]).all()
    assert found[-1, -1] == 99
    assert np.count_nonzero(np.diff(found[-1].astype(int))) < 99
