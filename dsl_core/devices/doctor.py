"""Every device of a rig tried by itself: all that is wrong at once, each with what to do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import Camera, CameraInfo, Device, Projector, Spectroradiometer, Stage
from dsl_core.devices.device_thread import DeviceThread, DriverError, HangingError
from dsl_core.devices.driver_table import (
    Driver,
    FoundDevice,
    Kind,
    find_driver,
    list_drivers,
    open_device,
    read_settings,
)
from dsl_core.devices.plausible import require_frame, require_spectrum, require_whole
from dsl_core.devices.profile import DevicePart, RigProfile
from dsl_core.errors import DeviceError, DslError
from dsl_core.model.frames import Frame
from dsl_core.model.rig import Rig, Sensor

T = TypeVar("T")
#: How long a device may take to open, to answer, and to measure a spectrum, s.
OPEN_S, ANSWER_S, MEASURE_S = 60.0, 40.0, 600.0
_TRIAL_MS = 20.0
_TRIAL_FRAMES = 3
#: With as many values, bits that none of them uses are not there.
_FEWEST_VALUES = 24
#: White has to be brighter than black by this share of full scale to count as seen.
_SEEN = 0.02


#: What findings on the file with the figures of data sheets are called.
DATA_SHEETS = "data sheets"


class Grade(StrEnum):
    """What a finding means for a scan."""

    GOOD = "good"
    WARNING = "warning"
    BAD = "bad"


@dataclass(frozen=True)
class Finding:
    """A sentence about a device, with what to do unless all is well."""

    device: str
    grade: Grade
    text: str


def survey() -> list[Finding]:
    """What each driver needs, and which devices it sees now; for a computer without a profile."""
    found: list[Finding] = []
    for entry in list_drivers():
        notes = _Notes(f"{entry.kind} {entry.name}", found)
        if entry.driver is None:
            notes.add(Grade.BAD, entry.error)
        elif entry.driver.find is not None:
            _look(entry.driver.find, notes)
        elif entry.driver.brings:
            notes.add(
                Grade.WARNING,
                f"It is not looked for: state its settings in a profile. It needs {entry.driver.brings}.",
            )
    return found


def examine(profile: RigProfile, nominal: Rig | None = None) -> list[Finding]:
    """Open and try every device of a profile, whatever the others do; nothing is moved.

    ``nominal`` is what its data sheets say, which has to fit the camera.
    """
    found = _shared_ports(profile)
    opened: dict[Kind, Device] = {}
    notes = {kind: _Notes(f"{kind} {part.driver}", found) for kind, part in profile.parts().items()}
    for kind, part in profile.parts().items():
        device = notes[kind].ask(
            partial(open_device, kind, part.driver, part.settings),
            OPEN_S,
            partial(_seen_instead, kind, part, notes[kind].thread),
        )
        if device is not None:
            opened[kind] = device
            _try(device, notes[kind])
    camera, projector = opened.get("camera"), opened.get("projector")
    if isinstance(camera, Camera) and isinstance(projector, Projector):
        _look_at_light(camera, projector, _Notes("camera and projector", found, notes["camera"].thread))
    if isinstance(camera, Camera) and nominal is not None:
        _compare(camera.info, nominal.sensor, _Notes(DATA_SHEETS, found))
    for kind, device in opened.items():
        notes[kind].ask(device.close, ANSWER_S)
        notes[kind].thread.end()
    return found


class _Notes:
    """What is found about one device, which is called on a thread of its own."""

    def __init__(self, name: str, found: list[Finding], thread: DeviceThread | None = None) -> None:
        self.name, self._found, self.thread = name, found, thread or DeviceThread(name)

    def add(self, grade: Grade, text: str) -> None:
        self._found.append(Finding(self.name, grade, text))

    def ask(
        self, action: Callable[[], T], patience_s: float, more: Callable[[str], str] = lambda text: ""
    ) -> T | None:
        """What an action returns; None when it fails, noted together with what ``more`` says of it."""
        try:
            return self.thread.call(self.name, action, patience_s)
        except HangingError as error:
            text = (
                f"It has not answered for {error.seconds:g} s. Switch it off and on again, and check that no"
                " other program uses it."
            )
        except DriverError as error:
            text = _said(error)
        self.add(Grade.BAD, f"{text} {more(text)}".strip())
        return None


def _said(error: DriverError) -> str:
    """What a driver's error says, and what to do if the driver does not."""
    cause = error.__cause__
    if isinstance(cause, DslError):
        return str(cause)
    return f"Its driver failed ({type(cause).__name__}: {cause}). Check its cable and settings."


def _look(find: Callable[[], list[FoundDevice]], notes: _Notes) -> None:
    """Note the devices that a driver sees; that it cannot look is a warning, as it may not be needed."""
    try:
        devices = notes.thread.call(notes.name, find, OPEN_S)
    except HangingError as error:
        notes.add(Grade.WARNING, f"Looking for devices has not ended for {error.seconds:g} s.")
    except DriverError as error:
        notes.add(Grade.WARNING, _said(error))
    else:
        for device in devices:
            notes.add(Grade.GOOD, f"{device.words}; settings {dict(device.settings)}")
        if not devices:
            notes.add(Grade.WARNING, "No device is connected, as far as this driver sees.")
    notes.thread.end()


def _shared_ports(profile: RigProfile) -> list[Finding]:
    """A finding for each serial port that several devices name."""
    users: dict[str, list[str]] = {}
    for kind, part in profile.parts().items():
        port = part.settings.get("port")
        if isinstance(port, str) and port:
            users.setdefault(port, []).append(kind)
    return [
        Finding(
            " and ".join(kinds),
            Grade.BAD,
            f"Both name the port {port}, and only one can be there. Give each its own.",
        )
        for port, kinds in users.items()
        if len(kinds) > 1
    ]


def _seen_instead(kind: Kind, part: DevicePart, thread: DeviceThread, trouble: str) -> str:
    """Which devices the driver sees, for one that cannot be opened; empty where ``trouble`` says so."""
    try:
        read_settings(kind, part.driver, part.settings)
        driver: Driver = find_driver(kind, part.driver)
        # What it fails with now says no more than why the device did not open.
        devices = [] if driver.find is None else thread.call(f"{kind} {part.driver}", driver.find, OPEN_S)
    except (DeviceError, DriverError, HangingError):
        return ""
    named = [str(value) for each in devices for value in each.settings.values()]
    if any(name and name in trouble for name in named):
        return ""
    return f"The driver sees: {'; '.join(each.words for each in devices)}." if devices else ""


def _try(device: Device, notes: _Notes) -> None:
    """Note what a device says and does."""
    if isinstance(device, Camera):
        _try_camera(device, notes)
    elif isinstance(device, Projector):
        _try_projector(device, notes)
    elif isinstance(device, Stage):
        where = notes.ask(lambda: (device.range_mm, device.position_mm), ANSWER_S)
        if where is not None:
            (low, high), position_mm = where
            notes.add(Grade.GOOD, f"at {position_mm:g} mm of {low:g} to {high:g} mm; it was not moved")
    elif isinstance(device, Spectroradiometer):
        _try_spectroradiometer(device, notes)


def _try_camera(camera: Camera, notes: _Notes) -> None:
    info = notes.ask(lambda: camera.info, ANSWER_S)
    if info is None:
        return
    low, high = info.exposure_range_ms
    region = f", region {info.region_px}" if info.region_px else ""
    notes.add(
        Grade.GOOD,
        f"{info.model} {info.serial}: {info.width_px} x {info.height_px} px{region}, {info.bayer},"
        f" {info.bit_depth} bits, binning {info.binning}, gain {info.gain_db:g} dB, exposure {low:g} to"
        f" {high:g} ms{_warmth(camera, notes)}",
    )
    frames = notes.ask(lambda: _frames(camera), ANSWER_S)
    if frames is None:
        return
    unused = _unused_bits(frames[-1].pixels)
    if info.bit_depth == 16 and unused:
        notes.add(
            Grade.WARNING,
            f"The lowest {unused} of 16 bits are always 0: its pixels are {16 - unused} bits moved up. Set"
            f" adc_bits to {16 - unused} in the profile.",
        )
    took_s = (frames[-1].timestamp_s - frames[0].timestamp_s) / (len(frames) - 1)
    notes.add(Grade.GOOD, f"{len(frames)} frames of {frames[0].exposure_ms:g} ms, one every {took_s:.3f} s")


def _compare(camera: CameraInfo, sensor: Sensor, notes: _Notes) -> None:
    """Note where the nominal sensor is not the camera's."""
    if (sensor.bayer, sensor.bit_depth) != (camera.bayer, camera.bit_depth):
        doubted = "" if sensor.bit_depth == camera.bit_depth else ": its black level is not believed"
        notes.add(
            Grade.WARNING,
            f"The nominal sensor is {sensor.bayer} of {sensor.bit_depth} bits, the camera {camera.bayer} of"
            f" {camera.bit_depth} bits{doubted}. Set the camera's pixel format, or"
            " correct bayer, bit_depth and black_level_dn of the file 'nominal'.",
        )


def _frames(camera: Camera) -> list[Frame]:
    """A few frames of a short exposure, each what the camera promises; raises `DeviceError`."""
    low, high = camera.info.exposure_range_ms
    actual_ms = camera.configure(min(max(_TRIAL_MS, low), high))
    frames = []
    for shot in range(_TRIAL_FRAMES):
        camera.prepare(shot)
        frames.append(camera.snap(actual_ms + 3000.0))
        require_frame(frames[-1], camera.info, actual_ms)
        require_whole(frames[-1].pixels, f"The camera {camera.info.model}")
    ids = [frame.frame_id for frame in frames]
    if ids != sorted(set(ids)):
        raise DeviceError(f"The camera numbers its frames {ids}, which must rise. Update its driver.")
    return frames


def _unused_bits(pixels: NDArray[np.uint16]) -> int:
    """How many of the lowest bits no pixel uses; 0 where too few different values would be a chance."""
    if len(np.unique(pixels)) < _FEWEST_VALUES:
        return 0
    used = int(np.bitwise_or.reduce(pixels, axis=None))
    return (used & -used).bit_length() - 1


def _warmth(camera: Camera, notes: _Notes) -> str:
    celsius = notes.ask(lambda: camera.temperature_c, ANSWER_S)
    return "" if celsius is None else f", {celsius:.1f} °C"


def _try_projector(projector: Projector, notes: _Notes) -> None:
    info = notes.ask(lambda: projector.info, ANSWER_S)
    if info is None:
        return
    black = np.zeros((info.height_px, info.width_px), np.uint8)
    if notes.ask(lambda: projector.show(black) or True, ANSWER_S):
        notes.add(
            Grade.GOOD,
            f"{f'{info.model} {info.serial}'.strip()}: {info.width_px} x {info.height_px} px,"
            f" {info.frame_period_ms:.2f} ms a frame, visible after {info.latency_ms:g} ms; the self-test"
            " measures that",
        )


def _try_spectroradiometer(instrument: Spectroradiometer, notes: _Notes) -> None:
    curve = notes.ask(instrument.measure, MEASURE_S)
    if curve is None:
        return
    try:
        require_spectrum(curve, "The spectroradiometer")
    except DeviceError as error:
        notes.add(Grade.WARNING, str(error))
    else:
        nm = curve.wavelengths_nm
        notes.add(Grade.GOOD, f"{len(nm)} values from {nm[0]:g} to {nm[-1]:g} nm, in {curve.unit}")


def _look_at_light(camera: Camera, projector: Projector, notes: _Notes) -> None:
    """Note whether the camera sees the projector's white against its black."""
    infos = notes.ask(lambda: (camera.info, projector.info), ANSWER_S)
    if infos is None:
        return
    if infos[1].model == "none":
        notes.add(Grade.WARNING, "There is no projector, so nothing can be scanned. Name one in the profile.")
        return
    means = notes.ask(lambda: [_mean(camera, projector, level) for level in (0, 255)], ANSWER_S)
    if means is None:
        return
    full = 2 ** infos[0].bit_depth - 1
    black, white = (mean / full for mean in means)
    if white - black < _SEEN:
        notes.add(
            Grade.WARNING,
            f"White reads {white:.1%} of full scale and black {black:.1%}: the camera does not see the"
            " projector's light. Take off lens caps, open the aperture, and aim both at one surface.",
        )
    else:
        notes.add(Grade.GOOD, f"white reads {white:.1%} of full scale, black {black:.1%}")


def _mean(camera: Camera, projector: Projector, level: int) -> float:
    info = projector.info
    projector.show(np.full((info.height_px, info.width_px), level, np.uint8))
    low, high = camera.info.exposure_range_ms
    actual_ms = camera.configure(min(max(3 * info.frame_period_ms, low), high))
    camera.prepare(level)
    return float(camera.snap(actual_ms + 3000.0).pixels.mean())
