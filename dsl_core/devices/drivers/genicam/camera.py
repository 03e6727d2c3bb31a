"""A camera of the GenICam standard: triggered when ready, bad frames taken again, found again when lost."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from dsl_core.devices.base import Camera, CameraInfo
from dsl_core.devices.drivers.frame_counter import FrameCounter
from dsl_core.devices.drivers.genicam.pixel_formats import right_aligned
from dsl_core.devices.drivers.genicam.port import GenicamPort, RawFrame
from dsl_core.devices.drivers.genicam.preparing import TRIGGER, Prepared, make_room, prepare
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame

_log = logging.getLogger(__name__)
_SEARCH_S = 0.25
#: An exposure that nobody has set and that differs by this share from the one in force is not ours any more.
_FORGOTTEN = 0.01
T = TypeVar("T")


@dataclass(frozen=True)
class FrameCounts:
    """What happened since the camera was opened."""

    asked: int = 0
    delivered: int = 0
    bad: int = 0
    late: int = 0
    reopened: int = 0


class GenicamCamera(Camera):
    """Takes single frames on a software trigger, whichever library its port is of."""

    def __init__(
        self,
        open_port: Callable[[], GenicamPort],
        settings: GenicamSettings,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Open and set up the camera that ``open_port`` finds; raises `DeviceError`."""
        self._open_port, self._settings = open_port, settings
        self._clock, self._sleep = clock, sleep
        self._numbers = FrameCounter()
        self.counts = FrameCounts()
        self._exposure_ms: float | None = None
        self._in_force_ms: float | None = None
        self._failed = self._is_closed = False
        self._port: GenicamPort | None = None
        self._prepared, self._info = self._open()

    @property
    def info(self) -> CameraInfo:
        """Identity, and what the camera was set to."""
        return self._info

    @property
    def temperature_c(self) -> float | None:
        """Temperature that the camera reports, °C; None where it does not."""
        port = self._ready_port()
        return float(port.read("DeviceTemperature")) if port.has("DeviceTemperature") else None

    def configure(self, exposure_ms: float) -> float:
        """Set the exposure and return what the camera then says; raises `DeviceError` outside the range."""
        low, high = self._info.exposure_range_ms
        if not (math.isfinite(exposure_ms) and low <= exposure_ms <= high):
            raise DeviceError(
                f"The camera {self._info.model} exposes {low:g} to {high:g} ms, not {exposure_ms:g} ms."
                " Change the plan's settings."
            )
        self._exposure_ms = exposure_ms
        return self._retrying(self._expose)

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        """Trigger an exposure and return its frame; a bad one is triggered again, a lost camera reopened."""
        self.counts = replace(self.counts, asked=self.counts.asked + 1)
        return self._retrying(lambda port: self._take(port, timeout_ms / 1000.0))

    def restart(self, meanwhile: Callable[[GenicamPort], None] = lambda port: None) -> None:
        """Drop frames on their way and acquire again; ``meanwhile`` may set what is locked otherwise."""
        port = self._ready_port()
        port.stop()
        meanwhile(port)
        port.start()
        # Some cameras count from 0 again, others do not.
        self._numbers.restart()

    def close(self) -> None:
        """Stop and release the camera."""
        self._is_closed = True
        self._let_go()

    def _let_go(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _open(self) -> tuple[Prepared, CameraInfo]:
        port = self._open_port()
        try:
            prepared = prepare(port, self._settings, self._sleep)
            port.start()
        except BaseException:
            port.close()
            raise
        self._port = port
        width, height = prepared.size_px
        return prepared, CameraInfo(
            port.model, port.serial, width, height, prepared.format.mosaic, prepared.bit_depth,
            prepared.exposure_range_ms, prepared.region_px, prepared.binning, prepared.gain_db,
            prepared.mirrored,
        )  # fmt: skip

    def _ready_port(self) -> GenicamPort:
        if self._port is None:
            raise DeviceError(f"The camera {self._info.model} is closed. Open the rig again.")
        return self._port

    def _retrying(self, action: Callable[[GenicamPort], T]) -> T:
        """Do something with the camera; if that fails because it is lost, find it and do it once more."""
        try:
            result = action(self._ready_port())
        except DeviceError as error:
            failed_before, self._failed = self._failed, True
            if self._is_closed:
                raise
            # A camera that was restarted meanwhile can be read, but gives an old connection no frames.
            if not failed_before and self._answers():
                raise
            _log.warning("the camera %s is lost (%s); searching for it", self._info.model, error)
            self._reopen(error)
            result = action(self._ready_port())
        return result

    def _answers(self) -> bool:
        """Whether the camera can still be read."""
        try:
            self._ready_port().read("Width")
        except DeviceError:
            return False
        return True

    def _reopen(self, lost: DeviceError) -> None:
        """Find the same camera and set it up as it was; raises `DeviceError` when it stays away."""
        self._let_go()
        until_s = self._clock() + self._settings.reconnect_s
        known = self._info
        while True:
            try:
                self._prepared, found = self._open()
                break
            except DeviceError as error:
                if self._clock() >= until_s:
                    raise DeviceError(
                        f"The camera {known.model} was lost ({lost}) and did not come back within"
                        f" {self._settings.reconnect_s:g} s ({error}). Check cable and power."
                    ) from error
            self._sleep(_SEARCH_S)
        if found != known:
            self._let_go()
            raise DeviceError(
                f"After the camera was lost, another one answered: {found} instead of {known}."
                " Connect the same camera again."
            )
        self._numbers.restart()
        self.counts = replace(self.counts, reopened=self.counts.reopened + 1)
        if self._exposure_ms is not None:
            self._expose(self._ready_port())

    def _expose(self, port: GenicamPort) -> float:
        assert self._exposure_ms is not None
        feature = self._prepared.exposure_feature
        make_room(port, self._exposure_ms)
        port.write(feature, 1000.0 * self._exposure_ms)
        # Some cameras keep the old value, or round it, without a word.
        self._in_force_ms = float(port.read(feature)) / 1000.0
        return self._in_force_ms

    def _exposure_in_force(self, port: GenicamPort) -> float:
        """The exposure, ms; raises `DeviceError` if it is none that was set.

        A camera that lost power for a moment comes back with its own exposure, gain and trigger, and some
        libraries reconnect to it silently: then everything has to be set up again.
        """
        exposure_ms, known_ms = float(port.read(self._prepared.exposure_feature)) / 1000.0, self._in_force_ms
        if known_ms is not None and abs(exposure_ms - known_ms) > _FORGOTTEN * known_ms:
            self._failed = True  # it answers, but not as it was set up
            raise DeviceError(
                f"The camera {self._info.model} exposes {exposure_ms:g} ms, but was set to {known_ms:g} ms:"
                " it restarted, or another program set it. Check its power supply, and let no other program"
                " use it."
            )
        return exposure_ms

    def _take(self, port: GenicamPort, timeout_s: float) -> Frame:
        exposure_ms = self._exposure_in_force(port)
        wait_s = exposure_ms / 1000.0 + self._settings.frame_wait_s
        until_s = self._clock() + timeout_s
        faults: list[str] = []
        while (left_s := until_s - self._clock()) > 0:
            if not port.wait_ready(left_s):
                faults.append("not ready for a trigger")
                continue
            triggered_s = self._clock()
            port.execute(TRIGGER)
            raw = port.fetch(min(wait_s, left_s))
            if raw is not None and not raw.fault:
                if faults:
                    self._exposure_in_force(port)  # what went wrong before may have been a restart
                frame = self._frame(raw, exposure_ms, triggered_s)
                self.counts = replace(self.counts, delivered=self.counts.delivered + 1)
                # Only a frame shows that a camera obeys: some accept settings from an old connection.
                self._failed = False
                return frame
            if raw is None:
                self.counts = replace(self.counts, late=self.counts.late + 1)
                faults.append("no frame came")
                # A frame that comes after all must not pass for the next one.
                self.restart()
            else:
                self.counts = replace(self.counts, bad=self.counts.bad + 1)
                faults.append(raw.fault)
        raise DeviceError(
            f"The camera {self._info.model} delivered no sound frame within {1000 * timeout_s:g} ms"
            f" ({'; '.join(faults[-3:]) or 'no time was given'}). Check its cable, and the packet size or"
            " bandwidth."
        )

    def _frame(self, raw: RawFrame, exposure_ms: float, triggered_s: float) -> Frame:
        info, known = self._info, self._prepared
        if (raw.width, raw.height, raw.pixel_format) != (info.width_px, info.height_px, known.format.name):
            raise DeviceError(
                f"The camera delivered {raw.width} x {raw.height} pixels of {raw.pixel_format} instead of"
                f" {info.width_px} x {info.height_px} of {known.format.name}. Let no other program set it."
            )
        pixels = known.format.unpack(raw.data, raw.width, raw.height)
        pixels = right_aligned(pixels, known.format.bits - info.bit_depth)
        return Frame(pixels, exposure_ms, triggered_s, self._numbers.number(raw.frame_id))
