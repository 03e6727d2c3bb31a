"""Seconds and peak memory of each stage of a computation."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

#: Memory is read this often; shorter peaks can be missed.
_INTERVAL_S = 0.05
#: Name of the attribute of a result that holds what its stages took, as JSON.
COSTS_ATTRIBUTE = "stage_costs"


@dataclass(frozen=True)
class StageCost:
    """What a stage took: wall seconds, and the largest resident memory of the process while it ran."""

    name: str
    seconds: float
    peak_bytes: int
    start_bytes: int


def costs_of(attributes: Mapping[Any, Any]) -> list[StageCost]:
    """What the stages of a result took by its attributes; none where that cannot be read."""
    from pydantic import TypeAdapter, ValidationError

    try:
        return TypeAdapter(list[StageCost]).validate_json(str(attributes.get(COSTS_ATTRIBUTE, "[]")))
    except ValidationError:
        return []


@dataclass
class StageTimer:
    """Collects the cost of stages; the same timer may be used from several places in turn.

    >>> timer = StageTimer()
    >>> with timer.stage("decode"):
    ...     total = sum(range(1000))
    >>> timer.stages[0].name
    'decode'
    """

    stages: list[StageCost] = field(default_factory=list)

    @contextmanager
    def stage(self, name: str, in_parts: bool = False) -> Iterator[None]:
        """Measure a block; its cost is kept also when it fails.

        With ``in_parts`` it belongs to what was done under that name before.
        """
        watch = _MemoryWatch()
        started = time.perf_counter()
        try:
            yield
        finally:
            seconds, peak = time.perf_counter() - started, watch.stop()
            self._add(StageCost(name, seconds, peak, watch.first), in_parts)

    def _add(self, cost: StageCost, in_parts: bool) -> None:
        for at, known in enumerate(self.stages):
            if in_parts and known.name == cost.name:
                seconds, peak = known.seconds + cost.seconds, max(known.peak_bytes, cost.peak_bytes)
                self.stages[at] = StageCost(known.name, seconds, peak, known.start_bytes)
                return
        self.stages.append(cost)


class _MemoryWatch:
    """Reads the resident memory of this process in a thread until it is stopped."""

    def __init__(self) -> None:
        import psutil

        self._process = psutil.Process()
        self.first = self._read()
        self._peak = self.first
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="memory watch")
        self._thread.start()

    def _read(self) -> int:
        return int(self._process.memory_info().rss)

    def _run(self) -> None:
        while not self._done.wait(_INTERVAL_S):
            self._peak = max(self._peak, self._read())

    def stop(self) -> int:
        """End the thread and return the largest value seen, bytes."""
        self._done.set()
        self._thread.join()
        return max(self._peak, self._read())
