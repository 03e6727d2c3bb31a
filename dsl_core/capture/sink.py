"""A scan in memory, for previews and tests, and a sink that lets someone watch."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.model.frames import Frame, FrameSink
from dsl_core.model.plan import CapturePlan, Shot, describe_shot

#: Sees every frame after it is stored.
Watch = Callable[[Shot, Frame], object]
_log = logging.getLogger(__name__)


class MemorySink:
    """Both `FrameSink` and `FrameSource`: frames are kept by shot index."""

    def __init__(self, plan: CapturePlan) -> None:
        """Start empty."""
        self._plan = plan
        self.frames: dict[int, Frame] = {}

    @property
    def plan(self) -> CapturePlan:
        """The plan the frames belong to."""
        return self._plan

    def missing(self) -> Iterator[Shot]:
        """Shots of the plan that are not saved yet, in order."""
        return (shot for shot in self._plan.shots() if shot.index not in self.frames)

    def write(self, shot: Shot, frame: Frame) -> None:
        """Keep a frame."""
        self.frames[shot.index] = frame

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The raw mosaic of a shot, shape (rows, columns); raises `StoreError` when it is not there."""
        try:
            return self.frames[shot.index].pixels
        except KeyError:
            raise StoreError(
                f"{describe_shot(shot).capitalize()} has not been captured. Run the scan to its end first."
            ) from None

    def close(self) -> None:
        """Nothing to finish."""


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

    def close(self) -> None:
        """Finish the sink."""
        self._sink.close()
