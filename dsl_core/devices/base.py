"""The verbs of a rig's devices and what they promise.

A driver implements one of these abstract classes in one file. Capabilities, latency and identity are
data (``info``), not methods. Every method may raise `DeviceError`, with a message that names the
device, what it was asked and what to do. Devices are context managers; ``close`` may be called twice.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DeviceError
from dsl_core.model.conditions import Mirrored
from dsl_core.model.frames import Frame
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import BayerPattern, Rig
from dsl_core.model.spectral import SpectralCurve

_log = logging.getLogger(__name__)


class Device(ABC):
    """Something that is opened, used and closed."""

    def close(self) -> None:
        """Release the hardware; a second call does nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()


@dataclass(frozen=True)
class CameraInfo:
    """What a camera is and delivers: the raw mosaic, ``bit_depth`` bits in uint16, right-aligned.

    ``region_px`` is x, y, width, height of the part of the sensor that is read, None for all of it, and
    ``mirrored`` how the camera turns its picture itself, None for one that does not say.
    """

    model: str
    serial: str
    width_px: int
    height_px: int
    bayer: BayerPattern
    bit_depth: int
    exposure_range_ms: tuple[float, float]
    region_px: tuple[int, int, int, int] | None = None
    binning: int = 1
    gain_db: float = 0.0
    mirrored: Mirrored | None = None


class Camera(Device):
    """Takes one exposure at a time."""

    @property
    @abstractmethod
    def info(self) -> CameraInfo:
        """Identity and capabilities; does not change while the camera is open."""

    @abstractmethod
    def configure(self, exposure_ms: float) -> float:
        """Set the exposure and return the one in force; raises `DeviceError` outside the range."""

    @property
    def temperature_c(self) -> float | None:
        """Temperature of the sensor now, °C; None for a camera that does not say."""
        return None

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        """Learn which shot of a plan, and which attempt at it, the next `snap` is for.

        Hardware need not care. A simulated camera draws its noise from these numbers, so that a scan
        that was interrupted and resumed equals an unbroken one.
        """

    @abstractmethod
    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        """Expose now and return the frame.

        The exposure starts after the call, so the frame shows what the projector shows at the time of
        the call. ``frame_id`` rises by at least one from frame to frame. Raises `DeviceError` when no frame
        arrives in time.
        """


@dataclass(frozen=True)
class ProjectorInfo:
    """What a projector is: logical size, and how long a pattern takes to become light.

    ``mode`` names the settings that change its light, such as colour temperature and brightness.
    """

    model: str
    serial: str
    width_px: int
    height_px: int
    latency_ms: float
    frame_period_ms: float
    mode: str = ""

    def require_image(self, image: NDArray[np.uint8]) -> None:
        """Raise `DeviceError` unless these are drive levels that this projector can show."""
        size = (self.height_px, self.width_px)
        if image.dtype != np.uint8 or image.shape not in (size, (*size, 3)):
            raise DeviceError(
                f"The projector was given an image of shape {image.shape} and type {image.dtype}; it shows"
                f" {size[0]} x {size[1]} pixels of uint8, grey or RGB. Make the pattern for its size."
            )


class Projector(Device):
    """Shows exact pixels."""

    @property
    @abstractmethod
    def info(self) -> ProjectorInfo:
        """Identity and capabilities."""

    @abstractmethod
    def show(self, image: NDArray[np.uint8]) -> None:
        """Show drive levels, shape (height, width) or (height, width, 3), from now on.

        Returns when the pattern is visible (latency included). Raises `DeviceError` for another size
        or type.
        """


class Stage(Device):
    """Moves the target along the camera axis; ``tolerance_mm`` is how far from a position it may stop."""

    tolerance_mm = 0.5

    @property
    @abstractmethod
    def range_mm(self) -> tuple[float, float]:
        """Smallest and largest position, mm."""

    @property
    @abstractmethod
    def position_mm(self) -> float:
        """Where the stage is, mm."""

    @abstractmethod
    def move_to(self, position_mm: float) -> float:
        """Move, wait until it has settled, and return the position reached, mm."""


class Spectroradiometer(Device):
    """Measures spectral radiance of a spot."""

    @abstractmethod
    def measure(self) -> SpectralCurve:
        """Measure once; the curve's unit is W/(sr m2 nm)."""


@dataclass(frozen=True)
class Patience:
    """How long devices may take before a call counts as hanging, s; beyond what it takes by itself.

    ``answer_s`` is for whatever should return at once. That of a picture is added to its time-out.
    """

    answer_s: float = 30.0
    move_s: float = 300.0
    measure_s: float = 600.0
    place_s: float = 600.0


@dataclass
class DeviceRig:
    """The devices of one rig, opened together and closed together.

    ``calibration`` is what is known of the rig (the twin knows itself); ``sleep`` is how its clock
    waits, so that a simulated rig does not have to. ``place`` puts a target before the camera where a rig can
    do that itself, as the twin can; where it is None, a person does it. A rig that places targets puts back
    what was there before with ``put_back``, and says in words with ``standing`` what is there now.
    ``expect`` is told the plan of a scan that begins or goes on, and gives what the scan should note of it.
    ``nominal`` is what data sheets say of the rig, the start of a calibration. ``filters`` holds measured
    transmissions of bandpass filters by their nominal centres, nm, as far as there are any. ``patience`` says
    when a call that does not return is given up. A rig that ``only_repeats`` plays back an earlier scan:
    there is nothing to measure with it.
    """

    name: str
    camera: Camera
    projector: Projector
    stage: Stage | None = None
    spectroradiometer: Spectroradiometer | None = None
    calibration: Rig | None = None
    sleep: Callable[[float], None] | None = None
    place: Callable[[Placement], None] | None = None
    put_back: Callable[[], None] | None = None
    standing: Callable[[], str] | None = None
    expect: Callable[[CapturePlan], dict[str, str]] | None = None
    nominal: Rig | None = None
    filters: dict[float, SpectralCurve] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    patience: Patience = Patience()
    only_repeats: bool = False

    def close(self) -> None:
        """Close every device, also when one of them fails to; raises the first failure at the end."""
        first: Exception | None = None
        for device in (self.projector, self.camera, self.stage, self.spectroradiometer):
            try:
                if device is not None:
                    device.close()
            except Exception as error:  # a broken device must not keep the others open
                first = first or error
        if first is not None:
            raise first

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close_quietly()

    def close_quietly(self) -> None:
        """Close every device; what one fails with is logged, as it spoils nothing that was done before."""
        try:
            self.close()
        except Exception as error:
            _log.warning("The devices of the rig %r did not close properly: %s", self.name, error)
