"""A camera set up for single raw frames on a software trigger, in the order that real cameras need.

The order is that of the published setup's camera (FLIR Grasshopper3): automatics off first, and read back
until they are, because gain and exposure are locked until then; region and format before bounds, which
depend on them; frame rate before exposure, which cameras clip to the period.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from dsl_core.devices.drivers.genicam.pixel_formats import PixelFormat, best_format, pixel_format
from dsl_core.devices.drivers.genicam.port import GenicamPort
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.errors import DeviceError
from dsl_core.model.conditions import Mirrored

#: Standard name first, then that of older cameras; both in microseconds.
EXPOSURE = ("ExposureTime", "ExposureTimeAbs")
TRIGGER = "TriggerSoftware"
_OFF: dict[str, float | str] = {
    "ExposureMode": "Timed",
    "ExposureAuto": "Off",
    "GainAuto": "Off",
    "BalanceWhiteAuto": "Off",
    "BlackLevelAuto": "Off",
    "AcquisitionFrameRateAuto": "Off",
    "GammaEnable": 0,
    "GammaEnabled": 0,
    "SharpnessEnabled": 0,
    "LUTEnable": 0,
}
_SETTLE_S = 1.0
_RATE = "AcquisitionFrameRate"
_RATE_SWITCHES = ("AcquisitionFrameRateEnable", "AcquisitionFrameRateEnabled")


@dataclass(frozen=True)
class Prepared:
    """What a camera was set to; ``region_px`` is in unbinned pixels of the sensor."""

    size_px: tuple[int, int]
    region_px: tuple[int, int, int, int]
    format: PixelFormat
    bit_depth: int
    binning: int
    gain_db: float
    exposure_range_ms: tuple[float, float]
    exposure_feature: str
    mirrored: Mirrored


def prepare(
    port: GenicamPort, settings: GenicamSettings, sleep: Callable[[float], None] = time.sleep
) -> Prepared:
    """Set a camera up, stopped; raises `DeviceError` for what it lacks or refuses."""
    exposure_feature = _require(port, EXPOSURE, "cannot set its exposure")
    _require(port, (TRIGGER,), "cannot be triggered by software")
    port.stop()
    _if_there(port, "TriggerMode", "Off")
    for feature, value in settings.features.items():
        port.write(feature, value)
    _switch_off(port, sleep)
    binning = _bin(port, settings.binning)
    chosen = _choose_format(port, settings.pixel_format)
    x, y, width, height = _set_region(port, settings.region_px, binning, chosen)
    # Which colour comes first may depend on where the region starts.
    chosen = pixel_format(str(port.read("PixelFormat"))) or chosen
    low_us, high_us = _exposure_bounds(port, exposure_feature)
    _trigger_by_software(port)
    return Prepared(
        size_px=(width, height),
        region_px=(x * binning, y * binning, width * binning, height * binning),
        format=chosen,
        bit_depth=settings.adc_bits if settings.adc_bits and chosen.bits == 16 else chosen.bits,
        binning=binning,
        gain_db=_set_gain(port, settings.gain_db),
        exposure_range_ms=(low_us / 1000.0, high_us / 1000.0),
        exposure_feature=exposure_feature,
        mirrored=_mirrored(port),
    )


def make_room(port: GenicamPort, exposure_ms: float) -> None:
    """Lower the frame rate, where it can be neither turned off nor ignored, to what an exposure leaves."""
    if any(port.has(switch) for switch in _RATE_SWITCHES) or not port.can_write(_RATE):
        return
    low, high = port.bounds(_RATE)
    port.write(_RATE, min(max(0.9 * 1000.0 / exposure_ms, low), high))


def _exposure_bounds(port: GenicamPort, feature: str) -> tuple[float, float]:
    """Exposures that the camera can do, µs, with the frame rate out of their way."""
    for switch in _RATE_SWITCHES:
        _if_there(port, switch, 0)
    make_room(port, math.inf)
    return port.bounds(feature)


def _require(port: GenicamPort, names: tuple[str, ...], lack: str) -> str:
    found = next((name for name in names if port.has(name)), None)
    if found is None:
        raise DeviceError(
            f"The camera {port.model} {port.serial} {lack}: it has no feature {' or '.join(names)}."
            " A scan needs a camera with exposure time and software trigger."
        )
    return found


def _if_there(port: GenicamPort, feature: str, value: float | str) -> bool:
    """Set a feature that not every camera has, or lets change; whether it was set."""
    if not (port.has(feature) and port.can_write(feature)):
        return False
    if isinstance(value, str) and value not in port.choices(feature):
        return False
    port.write(feature, value)
    return True


def _switch_off(port: GenicamPort, sleep: Callable[[float], None]) -> None:
    """Turn off whatever changes pixels by itself, and wait until the camera says so."""
    pending = {feature: value for feature, value in _OFF.items() if _if_there(port, feature, value)}
    waited_s = 0.0
    while pending := {feature: value for feature, value in pending.items() if port.read(feature) != value}:
        if waited_s >= _SETTLE_S:
            feature, value = next(iter(pending.items()))
            raise DeviceError(
                f"The camera {port.model} keeps {feature} at {port.read(feature)} instead of {value}."
                " Change it in its maker's program, or restart the camera."
            )
        sleep(0.02)
        waited_s += 0.02


def _bin(port: GenicamPort, binning: int) -> int:
    names = [name for name in ("BinningHorizontal", "BinningVertical") if port.has(name)]
    for name in names:
        if port.can_write(name):
            port.write(name, binning)
    in_force = {int(float(port.read(name))) for name in names} or {1}
    if in_force != {binning}:
        raise DeviceError(
            f"The camera {port.model} bins {' x '.join(map(str, sorted(in_force)))} pixels, not {binning} in"
            " both directions. Change binning in the profile."
        )
    return binning


def _choose_format(port: GenicamPort, name: str) -> PixelFormat:
    offered = port.choices("PixelFormat")
    chosen = pixel_format(name) if name else best_format(offered)
    if chosen is None or chosen.name not in offered:
        raw = ", ".join(each for each in offered if pixel_format(each)) or "none that is raw"
        raise DeviceError(
            f"The camera {port.model} has no raw pixel format {name!r}; it offers {raw}."
            " Change pixel_format in the profile."
        )
    port.write("PixelFormat", chosen.name)
    return chosen


def _set_region(
    port: GenicamPort, region_px: tuple[int, int, int, int] | None, binning: int, chosen: PixelFormat
) -> tuple[int, int, int, int]:
    """Set the part of the sensor that is read; x, y, width, height in binned pixels, as read back."""
    for name in ("OffsetX", "OffsetY"):
        _if_there(port, name, 0)
    largest = [int(port.bounds(name)[1]) for name in ("Width", "Height")]
    wanted = [part // binning for part in region_px] if region_px else [0, 0, *largest]
    if chosen.mosaic != "MONO" and any(part % 2 for part in wanted[:2]):
        raise DeviceError(
            f"The region {region_px} starts at an odd pixel, where the mosaic has another order."
            " Use even offsets for x and y."
        )
    names = ("Width", "Height", "OffsetX", "OffsetY")
    for name, value in zip(names, (*wanted[2:], *wanted[:2]), strict=True):
        if not port.has(name) and value == 0:
            continue
        low, high = port.bounds(name)
        if not low <= value <= high:
            raise DeviceError(
                f"The camera {port.model} has {name} from {low:g} to {high:g}, and the region {region_px}"
                f" with binning {binning} needs {value}. Change region_px in the profile."
            )
        if port.can_write(name):
            port.write(name, value)
    found = [int(float(port.read(name))) if port.has(name) else 0 for name in names]
    if found != [*wanted[2:], *wanted[:2]]:
        raise DeviceError(
            f"The camera {port.model} reads {found[0]} x {found[1]} pixels from {found[2]}, {found[3]}"
            f" instead of the region {region_px}; its steps may be coarser. Change region_px in the profile."
        )
    return found[2], found[3], found[0], found[1]


def _set_gain(port: GenicamPort, gain_db: float) -> float:
    if not port.has("Gain"):
        if gain_db:
            raise DeviceError(
                f"The camera {port.model} has no gain in dB, so {gain_db:g} dB cannot be set."
                " Set gain_db to 0 in the profile, and its own feature under features."
            )
        return 0.0
    low, high = port.bounds("Gain")
    if not low <= gain_db <= high:
        raise DeviceError(
            f"The camera {port.model} has a gain of {low:g} to {high:g} dB, not {gain_db:g} dB."
            " Change gain_db in the profile."
        )
    port.write("Gain", gain_db)
    return float(port.read("Gain"))


def _mirrored(port: GenicamPort) -> Mirrored:
    """How the camera turns its picture: what a calibration calls left is right then, or above below.

    Somebody may need that, as of a camera that hangs upside down, so that it is noted rather than set.
    """
    across, down = (port.has(name) and bool(port.read(name)) for name in ("ReverseX", "ReverseY"))
    if across:
        return "both ways" if down else "left to right"
    return "top to bottom" if down else "off"


def _trigger_by_software(port: GenicamPort) -> None:
    _if_there(port, "AcquisitionMode", "Continuous")
    _if_there(port, "TriggerSelector", "FrameStart")
    port.write("TriggerMode", "On")
    port.write("TriggerSource", "Software")
