"""A projector that shows nothing: for a camera, stage or spectroradiometer that is tried on its own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dsl_core.devices.base import Projector, ProjectorInfo
from dsl_core.devices.driver_table import Driver
from dsl_core.model.base import Record


class NoProjectorSettings(Record):
    """The size of the patterns that are shown nowhere."""

    size_px: tuple[int, int] = Field(default=(1280, 720), description="width and height of its patterns")
    latency_ms: float = Field(default=0.0, ge=0, description="latency it claims to have")
    frame_period_ms: float = Field(default=1000.0 / 60.0, gt=0, description="frame period it claims to have")


class NoProjector(Projector):
    """Accepts patterns of its size."""

    def __init__(self, settings: NoProjectorSettings) -> None:
        width, height = settings.size_px
        self._info = ProjectorInfo("none", "", width, height, settings.latency_ms, settings.frame_period_ms)

    @property
    def info(self) -> ProjectorInfo:
        """What the settings say."""
        return self._info

    def show(self, image: NDArray[np.uint8]) -> None:
        """Accept an image; raises `DeviceError` for another size or type."""
        self._info.require_image(image)


DRIVER = Driver("shows nothing; to try other devices without a projector", NoProjectorSettings, NoProjector)
