"""Memory that bands share."""

from __future__ import annotations

import numpy as np

from dsl_core.reconstruction.room import Room


def test_a_smaller_array_is_in_the_memory_of_the_one_before() -> None:
    room = Room()
    first = room.of("std", (3, 4, 5), np.float32)
    again = room.of("std", (2, 4, 5), np.float32)
    assert again.shape == (2, 4, 5)
    assert again.flags.c_contiguous
    assert np.shares_memory(first, again)


def test_uses_do_not_share_and_what_does_not_fit_is_made_anew() -> None:
    room = Room()
    radiance, std = (room.of(use, (6,), np.float32) for use in ("radiance", "std"))
    assert not np.shares_memory(radiance, std)
    larger, other = room.of("radiance", (2, 6), np.float32), room.of("std", (6,), np.float16)
    assert larger.shape == (2, 6)
    assert larger.dtype == np.float32
    assert other.dtype == np.float16
    assert not np.shares_memory(radiance, larger)


def test_nothing_is_kept_after_it_was_cleared() -> None:
    room = Room()
    before = room.of("std", (6,), np.uint16)
    room.clear()
    assert not np.shares_memory(before, room.of("std", (6,), np.uint16))
