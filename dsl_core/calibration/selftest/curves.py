"""What the figures of a self-test are taken from, as points to be drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.camera import ExposureLine, exposure_line, fit_dark, fit_transfer
from dsl_core.calibration.selftest.latency import is_right, trials
from dsl_core.calibration.selftest.projector import RAMPS, Colour, ramp_of
from dsl_core.calibration.selftest.readings import joined
from dsl_core.calibration.selftest.record import SelfTestCapture

Floats = NDArray[np.float64]

#: Drive levels that tell the power law well.
BRIGHT = 0.2


@dataclass(frozen=True)
class RampPoints:
    """Light of one colour ramp over that at full drive: drive levels 0..1 and light, both (n,)."""

    colour: Colour
    level: Floats
    light: Floats


@dataclass(frozen=True)
class SelfTestCurves:
    """Lines of red, green and blue; ramps; and the share of right pictures after each wait, both (waits,)."""

    lines: tuple[ExposureLine, ExposureLine, ExposureLine]
    full_scale_dn: float
    ramps: tuple[RampPoints, ...]
    waits_ms: Floats
    right_share: Floats


def selftest_curves(capture: SelfTestCapture) -> SelfTestCurves:
    """The points behind linearity, gamma and latency; raises `CalibrationError` as the analysis does."""
    parts, sizes = capture.parts, capture.sizes
    dark = fit_dark(parts["dark"], sizes)
    transfer = fit_transfer(joined(parts["dark"], parts["series"]), dark.level_dn.value, sizes)
    red, green, blue = (exposure_line(parts["series"], c, dark, transfer, sizes) for c in range(3))
    latency = parts["latency"]
    judged, asked, _ = trials(latency, is_right(latency))
    right = is_right(latency)[judged]
    waits, which = np.unique(asked, return_inverse=True)
    return SelfTestCurves(
        (red, green, blue),
        sizes.full_scale_dn,
        tuple(_ramp(capture, colour, dark.level_dn.value, dark.rate) for colour in RAMPS),
        waits,
        np.bincount(which, right) / np.bincount(which),
    )


def _ramp(capture: SelfTestCapture, colour: Colour, black_dn: float, dark_rate: Floats) -> RampPoints:
    """In the channel that sees most of the colour; clipped frames are left out.

    Light at full drive is that of the power law through the points, as full drive itself may be clipped.
    """
    ramp = ramp_of(capture.parts["ramps"], colour)
    rate = (ramp.mean_dn - black_dn) / ramp.exposure_ms[:, None] - dark_rate
    channel = int(rate[ramp.drive.max(1).argmax()].argmax())
    used = ramp.unclipped[:, channel]
    level, light = ramp.drive.max(1)[used] / 255, rate[used, channel]
    bright = (level > BRIGHT) & (light > 0)
    _, full = np.polyfit(np.log(level[bright]), np.log(light[bright]), 1)
    return RampPoints(colour, level, light / np.exp(full))
