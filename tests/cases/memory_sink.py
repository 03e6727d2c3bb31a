"""A scan in memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot, describe_shot


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

    def withdraw(self, shots: Iterable[Shot]) -> None:
        """Forget frames."""
        for shot in shots:
            self.frames.pop(shot.index, None)

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The raw mosaic of a shot, shape (rows, columns); raises `StoreError` when it is not there."""
        try:
            return self.frames[shot.index].pixels
        except KeyError:
            raise StoreError(
                f"{describe_shot(shot).capitalize()} has not been captured. Run the scan to its end first."
            ) from None

    def read_back(self) -> list[Shot]:
        """The shots whose frames are gone."""
        return list(self.missing())

    def close(self) -> None:
        """Nothing to finish."""
