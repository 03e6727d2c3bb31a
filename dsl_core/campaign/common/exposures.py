"""A white picture taken to see how bright each colour is, and exposures that suit it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError
from dsl_core.model.plan import Setting
from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import bayer_channels

#: Share of the range above black that white may reach; a line is dimmer by what the orders of others add.
FILL = 0.9
#: A picture for judging reaches a share of the range between these.
LEAST_FILL, MOST_FILL = 0.1, 0.9
#: The share of pixels that may be brighter than the brightness stated.
BRIGHTEST_SHARE = 0.005
#: Longest exposure that is chosen, ms; of a picture for judging, at most a third.
LONGEST_MS = 4000.0
#: Drive levels for a bracket, the brightest first, and the LED cycles that must not saturate.
LEVELS, CYCLES = (1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2), 6
#: White dimmer than this share of the range in the longest exposure is too dark to measure.
TOO_DARK = 0.02
_ATTEMPTS = 14


@dataclass(frozen=True)
class WhiteLevel:
    """White above black at full drive, DN per ms: brightest pixel, and means of R, G, B.

    ``ambient`` is what black shows above the sensor's black level, as a share of the brightest white;
    ``saturated`` says that even the darkest picture was. ``picture`` (rows, columns) is the mosaic itself, DN
    per ms at full drive.
    """

    brightest: float
    mean: NDArray[np.float64]
    ambient: float
    saturated: bool
    picture: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)), repr=False)


def measure_white(devices: DeviceRig, rig: Rig) -> WhiteLevel:
    """Show white and black and expose for whole LED cycles until white is neither dark nor saturated."""
    range_dn = rig.sensor.full_scale_dn - rig.sensor.black_level_dn
    level, cycles = 1.0, 1
    for attempt in range(_ATTEMPTS):
        exposure_ms = devices.camera.configure(cycles * rig.frame_period_ms)
        white, black = (_snap(devices, round(255 * level) * on, attempt) for on in (1, 0))
        above = white.astype(float) - black
        peak = float(np.quantile(above, 1 - BRIGHTEST_SHARE))
        if peak > MOST_FILL * range_dn and level > LEVELS[-1]:
            level = max(0.6 * level, LEVELS[-1])
        elif peak < LEAST_FILL * range_dn and exposure_ms < LONGEST_MS / 3:
            longer = min(max(0.3 * range_dn / max(peak, 1.0), 2.0), 8.0)
            cycles = math.ceil(min(cycles * longer, LONGEST_MS / 3 / rig.frame_period_ms + 1))
        else:
            break
    light = rig.projector_response.radiance(level) - rig.projector_response.radiance(0.0)
    rate = above / (exposure_ms * float(light))
    colours = bayer_channels(rig.sensor.bayer, *rate.shape)
    dark = float(np.median(black)) - rig.sensor.black_level_dn
    return WhiteLevel(
        float(np.quantile(rate, 1 - BRIGHTEST_SHARE)),
        np.array([rate[colours == colour].mean() for colour in range(3)]),
        max(dark, 0.0) / max(peak, 1.0),
        peak > MOST_FILL * range_dn,
        rate,
    )


def require_bright(rig: Rig, white: WhiteLevel, what: str) -> None:
    """Raise `CalibrationError` where even the longest exposure sees next to nothing of white."""
    longest = LONGEST_MS * white.brightest / (rig.sensor.full_scale_dn - rig.sensor.black_level_dn)
    if longest < TOO_DARK:
        raise CalibrationError(
            f"{what} is too dark: in {LONGEST_MS / 1000:g} s white reaches {longest:.1%} of the camera's"
            " range. Check lens cap, aperture, projector and filter."
        )


def bright_setting(rig: Rig, white: WhiteLevel, what: str) -> Setting:
    """Full drive, and as many LED cycles as white allows; raises `CalibrationError` where it is too dark."""
    range_dn = rig.sensor.full_scale_dn - rig.sensor.black_level_dn
    require_bright(rig, white, what)
    cycles = int(min(FILL * range_dn / white.brightest, LONGEST_MS) / rig.frame_period_ms)
    if cycles > 0:
        return Setting(exposure_ms=cycles * rig.frame_period_ms, level=1.0)
    return bracket(rig, white, what, 1.0, cycles=1)[0]


def bracket(
    rig: Rig, white: WhiteLevel, what: str, ratio: float, cycles: int = CYCLES
) -> tuple[Setting, ...]:
    """Two settings of one drive level: whole LED cycles that white does not saturate, and ``ratio`` as long.

    One level, so that no error of the projector's gamma comes between them. One setting where the ratio is 1.
    Raises `CalibrationError` where it is too dark.
    """
    require_bright(rig, white, what)
    range_dn = rig.sensor.full_scale_dn - rig.sensor.black_level_dn
    response = rig.projector_response
    for level in LEVELS:
        light = float(response.radiance(level) - response.radiance(0.0))
        fit = int(FILL * range_dn / (white.brightest * light) / rig.frame_period_ms)
        if fit >= cycles or level == LEVELS[-1]:
            break
    fit = max(min(fit, int(LONGEST_MS / rig.frame_period_ms / max(ratio, 1.0))), 1)
    short = Setting(exposure_ms=fit * rig.frame_period_ms, level=level)
    if ratio <= 1:
        return (short,)
    long = min(max(round(fit * ratio), fit + 1), int(LONGEST_MS / rig.frame_period_ms))
    return short, Setting(exposure_ms=long * rig.frame_period_ms, level=level)


def _snap(devices: DeviceRig, drive: int, attempt: int) -> NDArray[np.uint16]:
    info = devices.projector.info
    devices.projector.show(np.full((info.height_px, info.width_px), drive, np.uint8))
    (devices.sleep or time.sleep)(info.latency_ms / 1000)
    # Numbers of their own, so that the twin's noise here is not that of a scan.
    devices.camera.prepare(1_000_000 + drive, attempt)
    return devices.camera.snap().pixels
