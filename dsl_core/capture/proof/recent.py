"""What was worked out for the shots before and is needed again for the next ones."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")
#: Results that are kept: those of a shot and its neighbours, white and black.
KEPT = 8


class Recent(Generic[T]):
    """The last results of one kind, by numbers, for as long as their arguments are the same objects."""

    def __init__(self) -> None:
        self._kept: dict[int, tuple[tuple[object, ...], T]] = {}

    def get(self, number: int, given: tuple[object, ...], work: Callable[[], T]) -> T:
        """The result for a number; worked out unless it is there and was made from the same objects."""
        known = self._kept.get(number)
        if known is not None and all(map(operator.is_, known[0], given)):
            return known[1]
        while len(self._kept) >= KEPT:
            self._kept.pop(next(iter(self._kept)))
        found = work()
        self._kept[number] = given, found
        return found
