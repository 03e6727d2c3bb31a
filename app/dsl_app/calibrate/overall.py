"""How far a calibration of everything is, and what time it takes: by its steps and fits. No Qt."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

#: A share of the work that says enough about the pace of the rest.
LEAST_SHARE = 0.04


class Overall:
    """Counts the steps and the fit of each calibration as one part each; written in a worker, read by anyone.

    ``parts`` are the parts of every calibration in order. Those that turn out to be done count no more.
    """

    def __init__(self, parts: Mapping[str, int], clock: Callable[[], float] = time.monotonic) -> None:
        self._parts, self._clock = dict(parts), clock
        self._since_s = clock()
        self._finished: list[str] = []
        self._done, self._within = 0, 0.0
        #: The calibration that runs; empty before the first and after the last.
        self.name = ""

    def begins(self, name: str, missing: int) -> None:
        """A calibration begins that lacks so many steps; those before it that were not run had been done."""
        names = list(self._parts)
        for earlier in names[: names.index(name)] if name in names else ():
            if earlier not in self._finished:
                self._parts.pop(earlier)
        self.name, self._parts[name] = name, missing + 1
        self._done, self._within = -1, 0.0

    def next_part(self) -> None:
        """The next step of the calibration begins, or its fit."""
        self._done, self._within = min(self._done + 1, self._parts[self.name] - 1), 0.0

    def report(self, done: int, total: int) -> None:
        """Take a report of the current part."""
        if total > 0:
            self._within = max(self._within, min(done / total, 1.0))

    def ends(self) -> None:
        """The calibration is accepted."""
        self._finished.append(self.name)
        self.name, self._within = "", 0.0

    @property
    def share(self) -> float:
        """The share of the work that is done."""
        finished = sum(self._parts[name] for name in self._finished)
        current = max(self._done, 0) + self._within if self.name else 0.0
        return (finished + current) / max(sum(self._parts.values()), 1)

    @property
    def is_early(self) -> bool:
        """Whether a calibration runs, but too little is done to tell the time left."""
        return bool(self.name) and self.share < LEAST_SHARE

    def left_s(self) -> float | None:
        """The time left for all of it, s; None while too little is done to tell, or nothing left to count."""
        share = self.share
        if not LEAST_SHARE <= share < 1.0:
            return None
        return (self._clock() - self._since_s) * (1 - share) / share
