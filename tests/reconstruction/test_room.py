"""Memory that bands share."""

from __future__ import annotations

import numpy as np

from dsl_core.reconstruction.room import Room


def test_a_smaller_array_is_in_the_memory_of_the_one_before() -> None:
    room = Room()
    first = room.of((3, 4, 5), np.float32)
    again = room.of((2, 4, 5), np.float32)
    assert again.shape == (2, 4, 5)
    assert again.flags.c_contiguous
    assert np.shares_memory(first, again)


def test_types_do_not_share_and_larger_ones_are_made_anew() -> None:
    room = Room()
    single, half = room.of((6,), np.float32), room.of((6,), np.float16)
    assert not np.shares_memory(single, half)
    larger = room.of((2, 6), np.float32)
    assert larger.shape == (2, 6)
    assert larger.dtype == np.float32
    assert not np.shares_memory(single, larger)


def test_nothing_is_kept_after_it_was_cleared() -> None:
    room = Room()
    before = room.of((6,), np.uint16)
    room.clear()
    assert not np.shares_memory(before, room.of((6,), np.uint16))
