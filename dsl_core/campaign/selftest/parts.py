"""The parts of a self-test, a function each: colour cycle and latency, then light over whole cycles."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.focus import BarFrames, bar_levels
from dsl_core.calibration.selftest.latency import REFERENCE, first_failing, is_right
from dsl_core.calibration.selftest.projector import RAMPS
from dsl_core.calibration.selftest.readings import Readings, joined
from dsl_core.campaign.selftest.recorder import BLACK, CLIPPED_FROM, Drive, Recorder, grey
from dsl_core.campaign.selftest.survey import Survey
from dsl_core.errors import CalibrationError
from dsl_core.model.frames import Frame

Frames = tuple[NDArray[np.uint16], NDArray[np.uint16]]

#: Drive levels of the ramps; the lines of a scan use 51 and 204.
RAMP_LEVELS = (255, 230, 204, 179, 153, 128, 102, 77, 51, 38, 26)
_RAMP_AIM, _LONGEST_UNITS = 0.7, 20
_SERIES_UNITS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 20, 24, 28, 32)
#: As many exposures make a line.
_FEWEST_UNITS = 5
#: The strongest channel reaches its aim at this many units, weaker ones later.
_FULL_UNITS, _FULL_AIM = 16, 0.85
_DARK_PAIRS, _LONG_DARK_PAIRS = 4, 2
_REPEATS = 16
_MID_AIM = 0.6
#: How light falls with drive until it is measured, and tries to come within this share of an aim.
_GUESSED_GAMMA, _TRIES, _CLOSE = 2.2, 8, 0.1
#: Random waits between frames, ms; number and length of the short exposures of the cycle.
_GAPS_MS, _CYCLE_FRAMES, _SHORT_MS = (5.0, 45.0), 96, 1.5
#: Halvings of the short exposure until no moment of the cycle clips.
_HALVINGS = 4
#: Without time stamps: exposures, repeated, whose spread shows the cycle.
_SPREAD_MS = (*np.geomspace(3, 60, 40).tolist(), *np.linspace(62, 200, 16).tolist())
_SPREAD_REPEATS = 8
#: Waits after a picture, tried from the longest on; then the range between good and bad is halved.
_WAITS_MS = (400.0, 200.0, 100.0, 50.0, 25.0, 12.0, 6.0, 0.0)
_BISECTIONS, _TRIALS = 4, 3
#: After this long the right picture is certainly visible.
_SURE_MS = 1000.0


def capture_cycle(recorder: Recorder, seen: Survey, rng: np.random.Generator) -> Readings:
    """Short exposures of white at irregular times, none of them clipped."""
    shortest = recorder.devices.camera.info.exposure_range_ms[0]
    exposure_ms = max(min(_SHORT_MS, 0.75 * seen.white_ms), shortest)
    recorder.show(grey(1.0))
    for _ in range(_HALVINGS):
        for gap_ms in rng.uniform(*_GAPS_MS, _CYCLE_FRAMES):
            recorder.read(exposure_ms, gap_ms)
        readings = recorder.collect()
        if readings.unclipped.all() or exposure_ms <= shortest:
            break
        exposure_ms = max(exposure_ms / 2, shortest)
    return readings


def longest_units(recorder: Recorder, unit_ms: float) -> int:
    """How many units the longest exposure of the camera is, the fewest needed at least.

    Raises `CalibrationError` where it is shorter than these.
    """
    longest_ms = recorder.devices.camera.info.exposure_range_ms[1]
    units = int(longest_ms / unit_ms * (1 + 1e-9))
    if units < _FEWEST_UNITS:
        raise CalibrationError(
            f"The camera exposes {longest_ms:g} ms at most; the self-test needs up to"
            f" {_FEWEST_UNITS * unit_ms:.3g} ms, {_FEWEST_UNITS} exposures that differ by whole colour"
            " cycles of the projector. Choose a mode of the camera with longer exposures."
        )
    return units


def capture_spread(recorder: Recorder, seen: Survey, rate: float, rng: np.random.Generator) -> Readings:
    """Repeats at many exposures, for cameras without time stamps to trust."""
    exposures_ms = _possible(recorder, _SPREAD_MS)
    recorder.show(find_level(recorder, seen.black_dn, rate, max(exposures_ms)))
    for exposure_ms in exposures_ms:
        for gap_ms in rng.uniform(*_GAPS_MS, _SPREAD_REPEATS):
            recorder.read(exposure_ms, gap_ms)
    return recorder.collect()


def _possible(recorder: Recorder, exposures_ms: Sequence[float]) -> tuple[float, ...]:
    """Those exposures that the camera has, ms."""
    low, high = recorder.devices.camera.info.exposure_range_ms
    return tuple(each for each in exposures_ms if low <= each <= high)


def white_rate(cycle: Readings, black_dn: float) -> float:
    """Mean signal of white in the strongest channel, DN per ms; raises `CalibrationError` without any."""
    rate = float((cycle.mean_dn - black_dn).mean(0).max() / cycle.exposure_ms[0])
    if rate <= 0:
        raise CalibrationError(
            "The light went out. Check that the projector stays on and the target in view."
        )
    return rate


def capture_latency(recorder: Recorder, exposure_ms: float, drive: Drive) -> Readings:
    """Black and light in turn with ever shorter waits; two frames each, and sure ones for comparison."""
    for each in (BLACK, drive):
        recorder.show(each, settle_ms=_SURE_MS)
        for _ in range(REFERENCE + 1):
            recorder.read(exposure_ms)
    readings = recorder.collect()
    good, bad = max(_WAITS_MS), None
    for wait_ms in _WAITS_MS:
        readings = joined(readings, _trials(recorder, exposure_ms, drive, wait_ms))
        bad = first_failing(readings, is_right(readings))
        if bad is not None:
            break
        good = wait_ms
    for _ in range(_BISECTIONS if bad is not None and bad < good else 0):
        assert bad is not None
        middle = (good + bad) / 2
        readings = joined(readings, _trials(recorder, exposure_ms, drive, middle))
        failing = first_failing(readings, is_right(readings))
        good, bad = (good, middle) if failing == middle else (middle, bad)
    return readings


def _trials(recorder: Recorder, exposure_ms: float, drive: Drive, wait_ms: float) -> Readings:
    for _ in range(_TRIALS):
        for each in (BLACK, drive):
            recorder.show(each, settle_ms=0.0)
            recorder.read(exposure_ms, wait_ms)
            recorder.read(exposure_ms)
    return recorder.collect()


def find_level(
    recorder: Recorder, black_dn: float, white_rate: float, exposure_ms: float, aim: float = _MID_AIM
) -> Drive:
    """The grey that brings the strongest channel to a share of the scale, or white where that is darker.

    Raises `CalibrationError` when even the darkest grey clips.
    """
    wanted = aim * (recorder.full_scale_dn - black_dn)
    level = min((wanted / (white_rate * exposure_ms)) ** (1 / _GUESSED_GAMMA), 1.0)
    below, above = 0.0, np.inf
    for _ in range(_TRIES):
        drive = grey(max(level, 1 / 255))
        recorder.show(drive)
        bright = _brightest(recorder, recorder.snap(exposure_ms))
        clips = bright >= CLIPPED_FROM * recorder.full_scale_dn
        ratio = 0.5 if clips else wanted / max(bright - black_dn, 1.0)
        if abs(ratio - 1) < _CLOSE or (ratio > 1 and level >= 1):
            return drive
        below, above = (max(below, level), above) if ratio > 1 else (below, min(above, level))
        level = min(level * ratio ** (1 / _GUESSED_GAMMA), 1.0)
        if below > 0 and not below < level < above:
            # A guess that goes past what is known would go to and fro where light is steeper.
            level = (below * above) ** 0.5
    if clips:
        raise CalibrationError(
            f"The picture clips at {exposure_ms:.3g} ms even when the projector is nearly black: ambient"
            " light or the projector's black is too bright. Switch off lamps, then close the aperture."
        )
    return drive


def _brightest(recorder: Recorder, frame: Frame) -> float:
    """Nearly the largest number in the region."""
    assert recorder.region is not None
    flat = frame.pixels.ravel()
    return max(float(np.percentile(flat[where], 99.5)) for where in recorder.region.lit)


def capture_dark(recorder: Recorder, unit_ms: float) -> tuple[Readings, Frames]:
    """Pairs at the shortest and at a long exposure with the projector black; the first long frames.

    Raises `CalibrationError` when ambient light clips.
    """
    recorder.show(BLACK)
    for _ in range(_DARK_PAIRS):
        _pair(recorder, recorder.devices.camera.info.exposure_range_ms[0])
    units = min(_LONGEST_UNITS, longest_units(recorder, unit_ms))
    while _brightest(recorder, recorder.snap(units * unit_ms)) > 0.9 * recorder.full_scale_dn:
        if units == 1:
            raise CalibrationError(
                f"Ambient light alone saturates the picture within {unit_ms:.3g} ms, one colour cycle. Switch"
                " off lamps and keep daylight out."
            )
        units = units // 2
    frames = [_pair(recorder, units * unit_ms) for _ in range(_LONG_DARK_PAIRS)]
    return recorder.collect(), frames[0]


def capture_black(recorder: Recorder) -> Readings:
    """Black once more at the end of the test, and dark from then on."""
    recorder.show(BLACK)
    for _ in range(_DARK_PAIRS):
        _pair(recorder, recorder.devices.camera.info.exposure_range_ms[0])
    return recorder.collect()


def _pair(recorder: Recorder, exposure_ms: float) -> Frames:
    return recorder.read(exposure_ms).pixels, recorder.read(exposure_ms, pair=True).pixels


def capture_ramps(recorder: Recorder, unit_ms: float, black_dn: float) -> Readings:
    """White, red, green and blue from full drive down, exposed longer the darker they are."""
    most = min(_LONGEST_UNITS, longest_units(recorder, unit_ms))
    for leds in RAMPS.values():
        units, before = 1, RAMP_LEVELS[0]
        rate = 0.0
        for level in RAMP_LEVELS:
            if rate:
                predicted = rate * (level / before) ** _GUESSED_GAMMA * unit_ms
                units = int(np.clip(_RAMP_AIM * recorder.full_scale_dn / predicted, 1, most))
            recorder.show((level * leds[0], level * leds[1], level * leds[2]))
            _pair(recorder, units * unit_ms)
            rate = max(recorder.last_mean_dn - black_dn, 1.0) / (units * unit_ms)
            before = level
    return recorder.collect()


def capture_series(
    recorder: Recorder, unit_ms: float, black_dn: float, white_rate: float
) -> tuple[Readings, Readings]:
    """Pairs at rising exposures of one grey, and frames that clip."""
    longest = longest_units(recorder, unit_ms)
    series_units = [units for units in _SERIES_UNITS if units <= longest]
    full_units = min(_FULL_UNITS, max(longest // 2, _FEWEST_UNITS))
    recorder.show(find_level(recorder, black_dn, white_rate, full_units * unit_ms, _FULL_AIM))
    for units in series_units:
        _pair(recorder, units * unit_ms)
    series = recorder.collect()
    recorder.show(grey(1.0))
    _pair(recorder, series_units[-1] * unit_ms)
    return series, recorder.collect()


def capture_beat(
    recorder: Recorder,
    exposures_ms: tuple[float, ...],
    black_dn: float,
    white_rate: float,
    rng: np.random.Generator,
) -> Readings:
    """Repeats at irregular times at each exposure that the camera has."""
    exposures_ms = _possible(recorder, exposures_ms)
    recorder.show(find_level(recorder, black_dn, white_rate, max(exposures_ms)))
    for exposure_ms, gap_ms in product(exposures_ms, rng.uniform(*_GAPS_MS, _REPEATS)):
        recorder.read(exposure_ms, gap_ms)
    return recorder.collect()


def capture_bars(recorder: Recorder, unit_ms: float, black_dn: float, white_rate: float) -> BarFrames:
    """Bars and their inverse, two frames each."""
    drive = find_level(recorder, black_dn, white_rate, unit_ms)
    info = recorder.devices.projector.info
    taken: list[Frames] = []
    for inverse in (False, True):
        row = bar_levels(info.width_px, drive[0], inverse)
        recorder.show_image(np.repeat(row[None], info.height_px, 0), drive)
        taken.append((recorder.snap(unit_ms).pixels, recorder.snap(unit_ms).pixels))
    return BarFrames(taken[0], taken[1])
