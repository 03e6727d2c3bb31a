"""Frames as captured, and where they come from and go to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, Shot


@dataclass(frozen=True)
class Frame:
    """One exposure: the raw mosaic, uint16, shape (rows, columns), in DN, and how it was taken.

    ``attempts`` counts the exposures it took until this one was kept, and ``corrected`` says what an earlier
    one showed instead of the pattern; ``shown_s`` is the time of day, s, at which the projector had shown the
    pattern; ``even`` is the mosaic as if exposed for as long as others of its setting, None where it was (a
    runner sets all four).
    """

    pixels: NDArray[np.uint16]
    exposure_ms: float
    timestamp_s: float = 0.0
    frame_id: int = 0
    attempts: int = 1
    corrected: str = ""
    shown_s: float = 0.0
    even: NDArray[np.uint16] | None = None

    @property
    def seen(self) -> NDArray[np.uint16]:
        """The mosaic to compare with others of its setting, shape (rows, columns), DN."""
        return self.pixels if self.even is None else self.even


class FrameSource(Protocol):
    """A finished scan: a plan and, for every shot of it, a raw mosaic."""

    @property
    def plan(self) -> CapturePlan:
        """The plan the frames belong to."""

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The raw mosaic of a shot, shape (rows, columns); raises `StoreError` when it is not there."""


@runtime_checkable
class RowSource(Protocol):
    """A `FrameSource` that reads some rows of a mosaic at less cost than the whole."""

    def read_rows(self, shot: Shot, rows: slice) -> NDArray[np.uint16]:
        """Some rows of the raw mosaic of a shot, shape (rows, columns); raises `StoreError`."""


@runtime_checkable
class NotedSource(Protocol):
    """A `FrameSource` that knows why frames were captured again."""

    def corrected(self, shot: Shot) -> str:
        """What an earlier picture showed instead of the pattern of a shot; empty if there was none."""


def read_rows(source: FrameSource, shot: Shot, rows: slice) -> NDArray[np.uint16]:
    """Some rows of the raw mosaic of a shot, from any source; raises `StoreError`."""
    return source.read_rows(shot, rows) if isinstance(source, RowSource) else source.read(shot)[rows]


class FrameSink(Protocol):
    """Where a runner puts frames, one by one, safely."""

    def missing(self) -> Iterator[Shot]:
        """Shots of the plan that are not saved yet, in order."""

    def write(self, shot: Shot, frame: Frame) -> None:
        """Store a frame so that it survives a crash from this moment on; raises `StoreError`."""

    def withdraw(self, shots: Iterable[Shot]) -> None:
        """Take frames back that nobody believes any more, so that they are missing; raises `StoreError`."""

    def read_back(self) -> list[Shot]:
        """Look again at everything that is kept; the shots whose frames are not as they were written."""

    def close(self) -> None:
        """Finish; the sink may be reopened later."""
