"""Captures of the self-test that find the colour cycle and the latency."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.selftest.latency import REFERENCE, first_failing, is_right
from dsl_core.calibration.selftest.readings import Readings, joined
from dsl_core.campaign.selftest.eye import BLACK, Drive, Eye, grey
from dsl_core.campaign.selftest.light import find_level
from dsl_core.campaign.selftest.survey import Survey
from dsl_core.errors import CalibrationError

_FRAMES, _SHORT_MS, _GAPS_MS = 96, 1.5, (5.0, 45.0)
#: Halvings of the short exposure until no moment of the cycle clips.
_HALVINGS = 4
#: Without time stamps: exposures, repeated, whose spread shows the cycle.
_SPREAD_MS = (*np.geomspace(3, 60, 40).tolist(), *np.linspace(62, 200, 16).tolist())
_SPREAD_REPEATS = 8
#: Waits after a picture, tried from the longest on; then the range between good and bad is halved.
_WAITS_MS = (400.0, 200.0, 100.0, 50.0, 25.0, 12.0, 6.0, 0.0)
_BISECTIONS, _TRIALS = 4, 3
#: After this long the right picture is there for sure.
_SURE_MS = 1000.0


def capture_cycle(eye: Eye, seen: Survey, rng: np.random.Generator) -> Readings:
    """Short exposures of white at irregular times, none of them clipped."""
    shortest = eye.devices.camera.info.exposure_range_ms[0]
    exposure_ms = max(min(_SHORT_MS, 0.75 * seen.white_ms), shortest)
    eye.show(grey(1.0))
    for _ in range(_HALVINGS):
        for gap_ms in rng.uniform(*_GAPS_MS, _FRAMES):
            eye.read(exposure_ms, gap_ms)
        readings = eye.collect()
        if readings.unclipped.all() or exposure_ms <= shortest:
            break
        exposure_ms = max(exposure_ms / 2, shortest)
    return readings


def capture_spread(eye: Eye, seen: Survey, rate: float, rng: np.random.Generator) -> Readings:
    """Repeats at many exposures, for cameras without time stamps to trust."""
    eye.show(find_level(eye, seen.black_dn, rate, max(_SPREAD_MS)))
    for exposure_ms in _SPREAD_MS:
        for gap_ms in rng.uniform(*_GAPS_MS, _SPREAD_REPEATS):
            eye.read(exposure_ms, gap_ms)
    return eye.collect()


def white_rate(cycle: Readings, black_dn: float) -> float:
    """Mean signal of white in the strongest channel, DN per ms; raises `CalibrationError` without any."""
    rate = float((cycle.mean_dn - black_dn).mean(0).max() / cycle.exposure_ms[0])
    if rate <= 0:
        raise CalibrationError(
            "The light went out. Check that the projector stays on and the target in view."
        )
    return rate


def capture_latency(eye: Eye, exposure_ms: float, drive: Drive) -> Readings:
    """Black and light in turn with ever shorter waits; two frames each, and sure ones for comparison."""
    for each in (BLACK, drive):
        eye.show(each, settle_ms=_SURE_MS)
        for _ in range(REFERENCE + 1):
            eye.read(exposure_ms)
    readings = eye.collect()
    good, bad = max(_WAITS_MS), None
    for wait_ms in _WAITS_MS:
        readings = joined(readings, _trials(eye, exposure_ms, drive, wait_ms))
        bad = first_failing(readings, is_right(readings))
        if bad is not None:
            break
        good = wait_ms
    for _ in range(_BISECTIONS if bad is not None and bad < good else 0):
        assert bad is not None
        middle = (good + bad) / 2
        readings = joined(readings, _trials(eye, exposure_ms, drive, middle))
        failing = first_failing(readings, is_right(readings))
        good, bad = (good, middle) if failing == middle else (middle, bad)
    return readings


def _trials(eye: Eye, exposure_ms: float, drive: Drive, wait_ms: float) -> Readings:
    for _ in range(_TRIALS):
        for each in (BLACK, drive):
            eye.show(each, settle_ms=0.0)
            eye.read(exposure_ms, wait_ms)
            eye.read(exposure_ms)
    return eye.collect()
