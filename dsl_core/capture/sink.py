"""A sink that lets someone watch."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator

from dsl_core.model.frames import Frame, FrameSink
from dsl_core.model.plan import Shot

#: Sees every frame after it is stored.
Watch = Callable[[Shot, Frame], object]
_log = logging.getLogger(__name__)


class WatchedSink:
    """A `FrameSink` that shows each frame to someone once it is saved; their failure is only logged."""

    def __init__(self, sink: FrameSink, watch: Watch) -> None:
        """The sink stays the caller's."""
        self._sink, self._watch = sink, watch

    def missing(self) -> Iterator[Shot]:
        """Shots of the plan that are not saved yet, in order."""
        return self._sink.missing()

    def write(self, shot: Shot, frame: Frame) -> None:
        """Store a frame, then show it; raises `StoreError`."""
        self._sink.write(shot, frame)
        try:
            self._watch(shot, frame)
        except Exception:
            _log.exception("a watcher of the scan failed; the scan continues")

    def withdraw(self, shots: Iterable[Shot]) -> None:
        """Take frames back; raises `StoreError`."""
        self._sink.withdraw(shots)

    def read_back(self) -> list[Shot]:
        """The shots whose frames are not kept as they were written."""
        return self._sink.read_back()

    def close(self) -> None:
        """Finish the sink."""
        self._sink.close()
