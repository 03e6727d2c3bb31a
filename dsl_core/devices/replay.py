"""A rig that plays a finished scan back, shot by shot, as if it were taken again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import Camera, CameraInfo, DeviceRig, Projector, ProjectorInfo
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame, FrameSource
from dsl_core.model.plan import Shot
from dsl_core.model.rig import BayerPattern, Rig

#: What the rig is called in scans of it.
NAME = "replay"


class ReplayCamera(Camera):
    """Delivers the frame of the shot that was announced, at the time it would have been taken."""

    def __init__(
        self,
        source: FrameSource,
        bayer: BayerPattern = "RGGB",
        bit_depth: int = 12,
        exposed: FrameSource | None = None,
    ) -> None:
        """Play back ``source``; it stays open and belongs to the caller.

        ``exposed`` is the same scan with the exposures in force, which its camera may have rounded.
        """
        self._frames = exposed or source
        self._shots: tuple[Shot, ...] = tuple(source.plan.shots())
        width, height = source.plan.camera_size_px
        exposures = [setting.exposure_ms for setting in source.plan.settings]
        self._info = CameraInfo(
            "replay", source.plan.name, width, height, bayer, bit_depth, (min(exposures), max(exposures))
        )
        actual = [setting.exposure_ms for setting in self._frames.plan.settings]
        self._in_force_ms = dict(zip(exposures, actual, strict=True))
        self._exposure_ms = actual[0]
        self._index = 0
        self._taken = 0
        self._time_s = 0.0

    @property
    def info(self) -> CameraInfo:
        """Size, mosaic and exposures of the scan."""
        return self._info

    def configure(self, exposure_ms: float) -> float:
        """Choose among the exposures of the scan and return the one in force.

        Raises `DeviceError` outside their range.
        """
        low, high = self._info.exposure_range_ms
        if not low <= exposure_ms <= high:
            raise DeviceError(
                f"The replayed scan has exposures from {low:g} to {high:g} ms, not {exposure_ms:g} ms."
                " Use the plan of that scan."
            )
        self._exposure_ms = self._in_force_ms.get(exposure_ms, exposure_ms)
        return self._exposure_ms

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        """Choose the frame that `snap` delivers; raises `DeviceError` when the scan has none."""
        if not 0 <= shot_index < len(self._shots):
            raise DeviceError(
                f"The replayed scan has {len(self._shots)} shots; shot {shot_index} is not one of them."
                " Use the plan of that scan."
            )
        self._index = shot_index

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        """The saved frame; raises `StoreError` when it is damaged."""
        pixels = self._frames.read(self._shots[self._index]).copy()
        self._taken += 1
        self._time_s += self._exposure_ms / 1000.0
        return Frame(pixels, self._exposure_ms, self._time_s, self._taken)


class ReplayProjector(Projector):
    """Accepts the patterns of the scan and shows them nowhere."""

    def __init__(self, source: FrameSource, frame_period_ms: float) -> None:
        """Have the projector size of the scan."""
        width, height = source.plan.projector_size_px
        self._info = ProjectorInfo("replay", source.plan.name, width, height, 0.0, frame_period_ms)

    @property
    def info(self) -> ProjectorInfo:
        """Logical size of the scan's projector."""
        return self._info

    def show(self, image: NDArray[np.uint8]) -> None:
        """Accept an image; raises `DeviceError` for another size or type."""
        self._info.require_image(image)


def replay_rig(
    source: FrameSource,
    calibration: Rig | None = None,
    camera: CameraInfo | None = None,
    projector: ProjectorInfo | None = None,
    exposed: FrameSource | None = None,
) -> DeviceRig:
    """A rig whose camera plays back ``source``; it waits for nothing.

    Without a ``calibration``, the ``camera`` and ``projector`` that the scan was captured with say what
    mosaic of how many bits its frames are, and how long the projector shows one; usual ones are taken without
    these. ``exposed`` as for `ReplayCamera`. Raises `DeviceError` from its devices when asked for a shot or
    size that the scan does not have.
    """
    sensor = calibration.sensor if calibration else camera
    eye = (
        ReplayCamera(source, sensor.bayer, sensor.bit_depth, exposed)
        if sensor
        else ReplayCamera(source, exposed=exposed)
    )
    known = calibration or projector
    period_ms = known.frame_period_ms if known else 1000.0 / 60.0
    return DeviceRig(
        name=NAME,
        camera=eye,
        projector=ReplayProjector(source, period_ms),
        calibration=calibration,
        sleep=lambda seconds: None,
        only_repeats=True,
    )
