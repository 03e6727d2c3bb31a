"""Shows, waits, exposes and keeps of every frame what the self-test needs."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.readings import Readings, joined
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame

Drive = tuple[int, int, int]

BLACK: Drive = (0, 0, 0)
#: Attempts at a frame before a camera counts as broken.
_ATTEMPTS = 3
_TIMEOUT_MS = 1500.0
#: A camera may round the exposure it is asked for by this share.
_EXPOSURE_TOLERANCE = 0.05
#: Wait after a new picture until the latency is known.
_FIRST_SETTLE_MS = 500.0
#: Pixels of a frame whose values are counted.
_COUNTED = 4000
#: Pixels above this share of the largest number are clipped or about to be.
CLIPPED_FROM = 0.985
#: A channel has clipped if more than this share of its pixels has; and so many may read less than its end,
#: as dead ones do.
_ALL_CLIPPED, _MAY_READ_LESS = 0.98, 0.02
_NONE = [0.0, 0.0, 0.0]


def grey(level: float) -> Drive:
    """Drive of all LEDs for a level 0..1."""
    value = round(255 * min(max(level, 0.0), 1.0))
    return value, value, value


@dataclass(frozen=True)
class Region:
    """Pixels of a raw mosaic, as indices: well lit ones and those next to the picture, per channel."""

    lit: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]
    beside: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


@dataclass
class Recorder:
    """Records readings with camera and projector together.

    ``attempt`` tells the frames of a look from those that are kept; ``ceiling_dn`` is where signals end if
    that is below the end of the scale; ``counts`` is how often each value occurred, of some pixels of all
    frames.
    """

    devices: DeviceRig
    attempt: int = 0
    settle_ms: float = _FIRST_SETTLE_MS
    ceiling_dn: float = math.inf
    frames: int = 0
    show_s: list[float] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(2**16, np.int64))
    region: Region | None = None
    _started_s: float = field(default_factory=time.perf_counter)
    _drive: Drive = BLACK
    _since_show: int = 0
    _exposure_ms: float = 0.0
    _rows: list[Readings] = field(default_factory=list)
    _last: list[NDArray[np.uint16]] = field(default_factory=list)
    #: The frame before the last, while picture and exposure stay.
    _before_last: list[NDArray[np.uint16]] = field(default_factory=list)

    @property
    def full_scale_dn(self) -> float:
        """The largest number that light can reach: the end of the scale, or of the sensor before it."""
        return min(2.0**self.devices.camera.info.bit_depth - 1, self.ceiling_dn)

    @property
    def last_mean_dn(self) -> float:
        """Mean of the strongest channel of the last reading."""
        return float(self._rows[-1].mean_dn.max())

    @property
    def ends_dn(self) -> int | None:
        """The number that nearly all pixels of the last reading reach, None where no channel clipped."""
        limit = CLIPPED_FROM * self.full_scale_dn
        ends = [each for each in self._last if (each > limit).mean() > _ALL_CLIPPED]
        return min((int(np.quantile(each, _MAY_READ_LESS)) for each in ends), default=None)

    @property
    def duration_s(self) -> float:
        """Time from the first frame to the last, by the camera's time stamps where it has some."""
        stamps = self.times_s[-1] - self.times_s[0] if self.times_s else 0.0
        return stamps if stamps > 0 else time.perf_counter() - self._started_s

    def wait(self, ms: float) -> None:
        """Let the rig's clock run."""
        (self.devices.sleep or time.sleep)(ms / 1000)

    def show(self, drive: Drive, settle_ms: float | None = None) -> None:
        """Fill the picture with one colour and wait until it is visible."""
        info = self.devices.projector.info
        image = np.empty((info.height_px, info.width_px, 3), np.uint8)
        image[:] = drive
        self.show_image(image, drive, settle_ms)

    def show_image(self, image: NDArray[np.uint8], drive: Drive, settle_ms: float | None = None) -> None:
        """Show a picture and wait until it is visible; ``drive`` is what its bright parts are driven with."""
        start = time.perf_counter()
        self.devices.projector.show(image)
        self.show_s.append(time.perf_counter() - start)
        self._drive, self._since_show = drive, 0
        self._last, self._before_last = [], []
        self.wait(self.settle_ms if settle_ms is None else settle_ms)

    def snap(self, exposure_ms: float) -> Frame:
        """One frame; raises `DeviceError` when the camera fails repeatedly or exposes for another time."""
        camera, info = self.devices.camera, self.devices.camera.info
        if exposure_ms != self._exposure_ms:
            actual = camera.configure(exposure_ms)
            if abs(actual - exposure_ms) > _EXPOSURE_TOLERANCE * exposure_ms:
                raise DeviceError(
                    f"The camera {info.model} exposes for {actual:g} ms instead of {exposure_ms:g} ms. Switch"
                    " off its automatic exposure."
                )
            self._exposure_ms = exposure_ms
            self._last, self._before_last = [], []
        for attempt in range(_ATTEMPTS):
            camera.prepare(self.frames, self.attempt + attempt)
            try:
                frame = camera.snap(exposure_ms + _TIMEOUT_MS)
                break
            except DeviceError:
                if attempt + 1 == _ATTEMPTS:
                    raise
        if frame.pixels.shape != (info.height_px, info.width_px) or frame.pixels.dtype != np.uint16:
            raise DeviceError(
                f"The camera {info.model} delivered {frame.pixels.dtype} of shape {frame.pixels.shape}"
                f" instead of uint16 of shape {(info.height_px, info.width_px)}. Check its format and region."
            )
        self.frames += 1
        self.times_s.append(frame.timestamp_s)
        some = frame.pixels.ravel()[:: max(frame.pixels.size // _COUNTED, 1)]
        self.counts += np.bincount(some, minlength=self.counts.size)
        return frame

    def read(self, exposure_ms: float, gap_ms: float = 0.0, pair: bool = False) -> Frame:
        """Wait, expose and keep the readings; a ``pair`` is compared with the frame before."""
        assert self.region is not None, "the region is found before anything is read"
        if gap_ms:
            self.wait(gap_ms)
        frame = self.snap(exposure_ms)
        flat = frame.pixels.ravel()
        values = [flat[where] for where in self.region.lit]
        limit = CLIPPED_FROM * self.full_scale_dn
        pairs = [_half_spread(*two) for two in zip(self._last, values, strict=True)] if pair else []
        older = self._before_last if pair else []
        seconds = [_half_spread(*two)[0] for two in zip(older, values, strict=False)]
        self._rows.append(
            Readings(
                exposure_ms=np.array([frame.exposure_ms]),
                timestamp_s=np.array([frame.timestamp_s]),
                gap_ms=np.array([gap_ms], float),
                since_show=np.array([self._since_show], np.int64),
                drive=np.array([self._drive], np.int64),
                mean_dn=np.array([[each.mean() for each in values]]),
                beside_dn=np.array([[flat[w].mean() if len(w) else 0.0 for w in self.region.beside]]),
                clipped=np.array([[(each > limit).mean() for each in values]]),
                pair_variance_dn2=np.array([[each[0] for each in pairs] or _NONE]),
                pair_covariance_dn2=np.array([[each[1] for each in pairs] or _NONE]),
                second_variance_dn2=np.array([seconds or _NONE]),
                is_pair=np.array([pair]),
            )
        )
        self._before_last, self._last = self._last, values
        self._since_show += 1
        return frame

    def collect(self) -> Readings:
        """The readings since the last call."""
        rows, self._rows = self._rows, []
        return joined(*rows)


def _half_spread(first: NDArray[np.uint16], second: NDArray[np.uint16]) -> tuple[float, float]:
    """Half the variance of the difference of two frames of one region, DN^2.

    And half the covariance of what neighbouring pixels of it have.
    """
    off = second.astype(np.float64) - first
    off -= off.mean()
    spare = len(off) - 1
    return float(off @ off) / spare / 2, float(off[1:] @ off[:-1]) / spare / 2
