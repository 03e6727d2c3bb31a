"""From all readings of a self-test to its record, and to the points that its curves are drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.camera import (
    ExposureLine,
    black_change,
    check_camera,
    count_hot_pixels,
    exposure_line,
    fit_dark,
    fit_transfer,
    noise_of_frames,
    noise_of_pixels,
    straight_part,
)
from dsl_core.calibration.selftest.cycle import (
    Cycle,
    advised_exposures,
    check_beats,
    find_cycle,
    find_cycle_by_spread,
    has_trusted_times,
)
from dsl_core.calibration.selftest.focus import BarFrames, check_focus
from dsl_core.calibration.selftest.latency import check_latency, is_right, trials
from dsl_core.calibration.selftest.projector import RAMPS, check_projector, ramp_of
from dsl_core.calibration.selftest.readings import Readings, RegionSizes, joined
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.selftest import Colour, CycleCheck, SelfTest

#: Exposures of the published prototype, whose beat is measured for comparison.
PUBLISHED_MS = (160.0, 320.0)
#: Exposures preferred for scans; the advised ones are the nearest that hold whole cycles.
WANTED_MS = (500.0 / 3.0, 1000.0 / 3.0)
Floats = NDArray[np.float64]

#: Parts with pairs of frames at all sorts of light.
_LIT = ("ramps", "series")
#: Drive levels above which the power law is fitted.
BRIGHT = 0.2


@dataclass(frozen=True)
class SelfTestCapture:
    """All that is kept of the frames.

    ``parts`` are readings by name: ``dark``, ``cycle``, ``latency``, ``ramps``, ``series``, ``saturated``,
    ``beat``, ``black again``, and ``spread`` where time stamps could not be used. ``dark_frames`` are two
    long ones.
    """

    parts: Mapping[str, Readings]
    sizes: RegionSizes
    bars: BarFrames
    dark_frames: tuple[NDArray[np.uint16], NDArray[np.uint16]]
    wanted_ms: tuple[float, ...]
    shortest_ms: float
    claimed_latency_ms: float
    show_s: float
    frames: int
    duration_s: float


def analyse(capture: SelfTestCapture) -> SelfTest:
    """Everything that the readings say; raises `CalibrationError` naming the part that failed."""
    parts, sizes = capture.parts, capture.sizes
    dark = fit_dark(parts["dark"], sizes)
    black_dn = dark.level_dn.value
    transfer = fit_transfer(joined(parts["dark"], parts["series"]), black_dn, sizes)
    first, second = capture.dark_frames
    glow = np.array([np.median(first) - black_dn])
    noise_dn = float(transfer.mean_std(glow, np.ones(1, np.int64))[0])
    projector, ambient = check_projector(parts["ramps"], dark, transfer, sizes)
    cycle, method = cycle_of(parts["cycle"], parts.get("spread"), black_dn)
    period = cycle.period_ms
    whole = None if period is None else period.value
    hot = count_hot_pixels(first, second, noise_dn), first.size
    camera = check_camera(dark, transfer, parts["series"], parts["saturated"], hot, sizes)
    again = parts.get("black again")
    noise = {
        "black_change_dn": None if again is None else black_change(dark, again, transfer, sizes),
        "shared_by_pixels": noise_of_pixels(parts["dark"], joined(*(parts[each] for each in _LIT)), sizes),
        "shared_by_frames": noise_of_frames(parts["dark"], sizes),
    }
    return SelfTest(
        camera=camera.model_copy(update=noise),
        projector=projector,
        latency=check_latency(
            parts["latency"], capture.claimed_latency_ms, has_trusted_times(parts["cycle"]), capture.show_s
        ),
        cycle=CycleCheck(
            period_ms=period,
            modulation=cycle.modulation,
            method="timestamps" if method == "timestamps" else "spread",
            shortest_ms=capture.shortest_ms if whole is None else whole,
            wanted_ms=capture.wanted_ms,
            advised_ms=capture.wanted_ms if whole is None else advised_exposures(whole, capture.wanted_ms),
            beats=check_beats(parts["beat"], black_dn, transfer, sizes),
        ),
        focus=check_focus(capture.bars, black_dn),
        ambient=ambient,
        frames=capture.frames,
        duration_s=capture.duration_s,
    )


def cycle_of(cycle: Readings, spread: Readings | None, black_dn: float) -> tuple[Cycle, str]:
    """The cycle and how it was found; raises `CalibrationError` for light that varies without a cycle."""
    found = find_cycle(cycle, black_dn)
    if spread is None or not needs_spread(cycle, found):
        return found, "timestamps"
    found = find_cycle_by_spread(spread, black_dn)
    if found.period_ms is None and not found.is_steady:
        raise CalibrationError(
            f"The light varies by {found.modulation.value:.0%} without a cycle between 20 and 300 Hz, so no"
            " exposure is safe. Switch off lamps and daylight, warm up the projector, and switch off its"
            " dynamic contrast."
        )
    return found, "spread"


def needs_spread(cycle: Readings, found: Cycle) -> bool:
    """Whether the cycle has to be looked for without time stamps."""
    return not found.is_steady and (found.period_ms is None or not has_trusted_times(cycle))


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
    series = straight_part(parts["series"], dark, transfer, sizes)
    red, green, blue = (exposure_line(series, c, dark, transfer, sizes) for c in range(3))
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
