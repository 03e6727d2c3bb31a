"""Devices of other packages, guarded: they return in time, fail with a sentence, and deliver what can be.

Whatever a driver raises becomes a `DeviceError` that names the device and what it was asked, so that a shot
is tried again and a scan can be resumed. A call that does not return is given up; see `device_thread`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from dsl_core.devices.base import (
    Camera,
    CameraInfo,
    Device,
    DeviceRig,
    Patience,
    Projector,
    ProjectorInfo,
    Spectroradiometer,
    Stage,
)
from dsl_core.devices.device_thread import DeviceThread, DriverError, HangingError
from dsl_core.devices.plausible import (
    has_dark,
    require_frame,
    require_position,
    require_spectrum,
    require_whole,
)
from dsl_core.errors import DeviceError, DslError
from dsl_core.model.base import problems_in_words
from dsl_core.model.frames import Frame
from dsl_core.model.placement import Placement
from dsl_core.model.spectral import SpectralCurve

_log = logging.getLogger(__name__)
T = TypeVar("T")
#: Longest text of a driver's error that is quoted.
_QUOTED = 200
#: A larger share of a row than this is not of dead pixels.
_DEAD = 0.01


class _HangsError(DeviceError):
    """A device does not return; another try would hang as well."""


def guarded(rig: DeviceRig, thread: DeviceThread | None) -> DeviceRig:
    """The same rig behind guards, which call its drivers on ``thread``; None calls them where one is.

    Raises `DeviceError` when a device does not even say what it is.
    """
    try:
        return _behind_guards(rig, thread)
    except DeviceError:
        _let_go(rig, thread)
        raise


def _behind_guards(rig: DeviceRig, thread: DeviceThread | None) -> DeviceRig:
    line, patience = _Line(thread), rig.patience
    devices: dict[str, Any] = {
        "camera": _Camera(rig.camera, line, patience),
        "projector": _Projector(rig.projector, line, patience),
    }
    if rig.stage is not None:
        devices["stage"] = _Stage(rig.stage, line, patience)
    if rig.spectroradiometer is not None:
        devices["spectroradiometer"] = _Spectroradiometer(rig.spectroradiometer, line, patience)
    line.open_devices = len(devices)
    place, put_back, standing, expect = rig.place, rig.put_back, rig.standing, rig.expect
    hand = f"The rig {rig.name!r}"
    if place is not None:
        devices["place"] = lambda what: _place(line, hand, place, what, patience)
    if put_back is not None:
        devices["put_back"] = lambda: line.ask(hand, "put its target back", put_back, patience.place_s)
    if standing is not None:
        devices["standing"] = lambda: line.ask(hand, "say what stands there", standing, patience.answer_s)
    if expect is not None:
        devices["expect"] = lambda plan: line.ask(
            hand, "prepare for a plan", lambda: expect(plan), patience.place_s
        )
    return replace(rig, **devices)


def _let_go(rig: DeviceRig, thread: DeviceThread | None) -> None:
    """Close what did open, so that another try finds it free; what does not close either is logged."""
    line = _Line(thread)
    for name, device in (
        ("The camera", rig.camera),
        ("The projector", rig.projector),
        ("The stage", rig.stage),
        ("The spectroradiometer", rig.spectroradiometer),
    ):
        if device is None:
            continue
        try:
            line.ask(name, "close", device.close, rig.patience.answer_s)
        except DslError as error:
            _log.warning("%s", error)
    if thread is not None:
        thread.end()


def open_on(thread: DeviceThread | None, name: str, action: Callable[[], T]) -> T:
    """What ``action`` returns, which opens the rig ``name``; raises `DeviceError` if it never returns."""
    if thread is None:
        return action()
    try:
        return thread.call(name, action, Patience().place_s)
    except DriverError as error:
        raise error.__cause__ or error from None
    except HangingError as error:
        raise DeviceError(
            f"The rig {name!r} has not opened for {error.seconds:g} s. Check that its devices are on and that"
            " no other program uses them."
        ) from None


@dataclass
class _Line:
    """The way to all devices of a rig, and how many of them are open."""

    thread: DeviceThread | None
    open_devices: int = 0

    def ask(self, name: str, verb: str, action: Callable[[], T], patience_s: float) -> T:
        """What a device returns; ``name`` begins a sentence and ``verb`` says what it was asked to do."""
        try:
            return action() if self.thread is None else self.thread.call(name, action, patience_s)
        except DslError:
            raise
        except HangingError as error:
            _tell_hanging(name, verb, error.seconds)
        except DriverError as error:
            cause = error.__cause__
            if isinstance(cause, DslError):
                raise cause from None
            _tell_failed(name, verb, cause)
        except Exception as error:
            _tell_failed(name, verb, error)

    def closed(self) -> None:
        """One device fewer is open; with the last one, the thread ends."""
        self.open_devices -= 1
        if self.open_devices == 0 and self.thread is not None:
            self.thread.end()


def _two_digits(seconds: float) -> str:
    """A time as people wait for it.

    >>> _two_digits(4.56667), _two_digits(0.05), _two_digits(300.0)
    ('4.6', '0.05', '300')
    """
    return f"{float(f'{seconds:.2g}'):g}"


def _tell_hanging(name: str, verb: str, seconds: float) -> NoReturn:
    raise _HangsError(
        f"{name} was asked to {verb}, but has not returned for {_two_digits(seconds)} s. Switch it off and on"
        " again or reconnect its cable, then continue. If it is only slow, ask whoever wrote its driver to"
        " allow it more time."
    ) from None


def _tell_failed(name: str, verb: str, error: BaseException | None) -> NoReturn:
    text = " ".join((problems_in_words(error) if isinstance(error, ValidationError) else str(error)).split())
    text = text if len(text) <= _QUOTED else text[: _QUOTED - 3] + "..."
    kind = type(error).__name__
    reason = f"{kind}: {text}" if text else kind
    raise DeviceError(
        f"{name} could not {verb} ({reason}). Check its cable and power, and that no other program uses it."
    ) from error


def _place(
    line: _Line, hand: str, place: Callable[[Placement], None], what: Placement, patience: Patience
) -> None:
    line.ask(hand, "place a target", lambda: place(what), patience.place_s)


class _Guard(Device):
    """What the guards of all devices do alike."""

    def __init__(self, device: Device, line: _Line, patience: Patience, name: str) -> None:
        self._device, self._line, self._patience, self._name = device, line, patience, name
        self._is_open = True

    def close(self) -> None:
        """Close the device behind, once."""
        if self._is_open:
            self._line.ask(self._name, "close", self._device.close, self._patience.answer_s)
            self._is_open = False
            self._line.closed()


class _Camera(_Guard, Camera):
    def __init__(self, camera: Camera, line: _Line, patience: Patience) -> None:
        self._camera = camera
        self._info = line.ask("The camera", "say what it is", lambda: camera.info, patience.answer_s)
        super().__init__(camera, line, patience, f"The camera {self._info.model}")
        self._exposure_ms: float | None = None
        #: Whether a first row, which is never cut off, had a pixel without any count: no black level.
        self._had_zero = False
        #: Which rows had counts in all their pixels at some time, and which had none in the last picture.
        self._filled, self._empty = np.zeros((2, self._info.height_px), bool)
        #: Whether a row with counts had a pixel without any, as light that falls off to nothing leaves some.
        self._had_dark = False

    @property
    def info(self) -> CameraInfo:
        return self._info

    def configure(self, exposure_ms: float) -> float:
        self._exposure_ms = None
        actual = self._ask(
            f"set an exposure of {exposure_ms:g} ms", lambda: float(self._camera.configure(exposure_ms))
        )
        self._exposure_ms = actual
        return actual

    @property
    def temperature_c(self) -> float | None:
        return self._ask("say its temperature", lambda: self._camera.temperature_c)

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        self._ask("prepare for a shot", lambda: self._camera.prepare(shot_index, attempt))

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        camera = self._camera
        frame, info = self._ask(
            "take a picture", lambda: (camera.snap(timeout_ms), camera.info), timeout_ms / 1000.0
        )
        _require_same(self._name, self._info, info)
        require_frame(frame, info, self._exposure_ms)
        # A driver may fill the same memory again with its next picture, and may have masked pixels of it.
        pixels = np.array(frame.pixels)
        self._require_whole(pixels)
        return replace(frame, pixels=pixels, frame_id=int(frame.frame_id))

    def _require_whole(self, pixels: NDArray[np.uint16]) -> None:
        """Raise `DeviceError` for rows that are missing: not for dark ones of a camera without black level.

        Rows that are dark again, and never were anything else, are where no light comes from, if dark places
        of others had no count either: there a black level would show.
        """
        empty = pixels.max(axis=1) == 0
        self._had_dark = self._had_dark or has_dark(pixels)
        is_again = np.array_equal(empty, self._empty) and not (empty & self._filled).any()
        self._empty = empty
        self._filled |= pixels.min(axis=1) > 0
        if not (self._had_zero or (is_again and self._had_dark)):
            require_whole(pixels, self._name)
        self._had_zero |= bool(np.mean(pixels[0] == 0) > _DEAD)

    def _ask(self, verb: str, action: Callable[[], T], more_s: float = 0.0) -> T:
        return self._line.ask(self._name, verb, action, self._patience.answer_s + more_s)


class _Projector(_Guard, Projector):
    def __init__(self, projector: Projector, line: _Line, patience: Patience) -> None:
        self._projector = projector
        self._info = line.ask("The projector", "say what it is", lambda: projector.info, patience.answer_s)
        super().__init__(projector, line, patience, f"The projector {self._info.model}")

    @property
    def info(self) -> ProjectorInfo:
        return self._info

    def show(self, image: NDArray[np.uint8]) -> None:
        projector = self._projector

        def shown() -> ProjectorInfo:
            projector.show(image)
            return projector.info

        patience_s = self._patience.answer_s + self._info.latency_ms / 1000.0
        _require_same(self._name, self._info, self._line.ask(self._name, "show a pattern", shown, patience_s))


class _Stage(_Guard, Stage):
    def __init__(self, stage: Stage, line: _Line, patience: Patience) -> None:
        super().__init__(stage, line, patience, "The stage")
        self._stage = stage
        self.tolerance_mm = stage.tolerance_mm
        self._range_mm: tuple[float, float] | None = None

    @property
    def range_mm(self) -> tuple[float, float]:
        # Asked once: it does not change, and what is planned with it must not wait for a stage that moves.
        if self._range_mm is None:
            stage, answer_s = self._stage, self._patience.answer_s
            self._range_mm = self._line.ask(self._name, "say its range", lambda: stage.range_mm, answer_s)
        return self._range_mm

    @property
    def position_mm(self) -> float:
        stage, answer_s = self._stage, self._patience.answer_s
        return self._line.ask(self._name, "say where it is", lambda: float(stage.position_mm), answer_s)

    def move_to(self, position_mm: float) -> float:
        try:
            return self._move(position_mm)
        except _HangsError:
            raise
        except DeviceError:
            return self._move(position_mm)  # a stage that stuck or overshot once may well arrive now

    def _move(self, position_mm: float) -> float:
        stage = self._stage
        reached_mm, read_mm = self._line.ask(
            self._name,
            f"move to {position_mm:g} mm",
            lambda: (float(stage.move_to(position_mm)), float(stage.position_mm)),
            self._patience.move_s,
        )
        require_position(position_mm, reached_mm, read_mm, self.tolerance_mm, self._name)
        return reached_mm


class _Spectroradiometer(_Guard, Spectroradiometer):
    def __init__(self, instrument: Spectroradiometer, line: _Line, patience: Patience) -> None:
        super().__init__(instrument, line, patience, "The spectroradiometer")
        self._instrument = instrument

    def measure(self) -> SpectralCurve:
        try:
            return self._measure()
        except _HangsError:
            raise
        except DeviceError:
            return self._measure()

    def _measure(self) -> SpectralCurve:
        curve = self._line.ask(self._name, "measure", self._instrument.measure, self._patience.measure_s)
        require_spectrum(curve, self._name)
        return curve


def _require_same(name: str, before: CameraInfo | ProjectorInfo, now: CameraInfo | ProjectorInfo) -> None:
    """Raise `DeviceError` when a device says of itself what it did not say when it was opened."""
    if before == now:
        return
    changed = [
        f"{each.name} from {getattr(before, each.name)} to {getattr(now, each.name, None)}"
        for each in fields(before)
        if getattr(before, each.name) != getattr(now, each.name, None)
    ]
    raise DeviceError(
        f"{name} changed {', '.join(changed)} while it was in use. Set it back, and let no other program or"
        " automatic mode change it."
    )
