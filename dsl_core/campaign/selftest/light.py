"""Captures of the self-test that measure light: all exposures hold whole colour cycles."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.focus import BarFrames, bar_levels
from dsl_core.calibration.selftest.projector import RAMPS
from dsl_core.calibration.selftest.readings import Readings
from dsl_core.campaign.selftest.eye import BLACK, CLIPPED_FROM, Drive, Eye, grey
from dsl_core.errors import CalibrationError
from dsl_core.model.frames import Frame

Frames = tuple[NDArray[np.uint16], NDArray[np.uint16]]

#: Drive levels of the ramps; the lines of a scan use 51 and 204.
RAMP_LEVELS = (255, 230, 204, 179, 153, 128, 102, 77, 51, 38, 26)
_RAMP_AIM, _LONGEST_UNITS = 0.7, 20
_SERIES_UNITS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 20, 24, 28, 32)
#: The strongest channel reaches its aim at this many units, weaker ones later.
_FULL_UNITS, _FULL_AIM = 16, 0.85
_DARK_PAIRS, _LONG_DARK_PAIRS = 4, 2
_REPEATS, _GAPS_MS = 16, (5.0, 45.0)
_MID_AIM = 0.6
#: How light falls with drive until it is measured, and tries to come within this share of an aim.
_GUESSED_GAMMA, _TRIES, _CLOSE = 2.2, 8, 0.1


def find_level(
    eye: Eye, black_dn: float, white_rate: float, exposure_ms: float, aim: float = _MID_AIM
) -> Drive:
    """The grey that brings the strongest channel to a share of the scale, or white where that is darker.

    Raises `CalibrationError` when even the darkest grey clips.
    """
    wanted = aim * (eye.full_scale_dn - black_dn)
    level = min((wanted / (white_rate * exposure_ms)) ** (1 / _GUESSED_GAMMA), 1.0)
    for _ in range(_TRIES):
        drive = grey(max(level, 1 / 255))
        eye.show(drive)
        bright = _brightest(eye, eye.snap(exposure_ms))
        clips = bright >= CLIPPED_FROM * eye.full_scale_dn
        ratio = 0.5 if clips else wanted / max(bright - black_dn, 1.0)
        if abs(ratio - 1) < _CLOSE or (ratio > 1 and level >= 1):
            return drive
        level = min(level * ratio ** (1 / _GUESSED_GAMMA), 1.0)
    if clips:
        raise CalibrationError(
            f"The picture clips at {exposure_ms:.3g} ms even when the projector is nearly black: ambient"
            " light or the projector's black is too bright. Switch lamps off, then close the aperture."
        )
    return drive


def _brightest(eye: Eye, frame: Frame) -> float:
    """Nearly the largest number in the region."""
    assert eye.region is not None
    flat = frame.pixels.ravel()
    return max(float(np.percentile(flat[where], 99.5)) for where in eye.region.lit)


def capture_dark(eye: Eye, unit_ms: float) -> tuple[Readings, Frames]:
    """Pairs at the shortest and at a long exposure with the projector black; the first long frames.

    Raises `CalibrationError` when ambient light clips.
    """
    eye.show(BLACK)
    for _ in range(_DARK_PAIRS):
        _pair(eye, eye.devices.camera.info.exposure_range_ms[0])
    units = _LONGEST_UNITS
    while _brightest(eye, eye.snap(units * unit_ms)) > 0.9 * eye.full_scale_dn:
        if units == 1:
            raise CalibrationError(
                f"Ambient light alone fills the scale within {unit_ms:.3g} ms, one colour cycle. Switch lamps"
                " off and keep daylight out."
            )
        units = units // 2
    frames = [_pair(eye, units * unit_ms) for _ in range(_LONG_DARK_PAIRS)]
    return eye.collect(), frames[0]


def _pair(eye: Eye, exposure_ms: float) -> Frames:
    return eye.read(exposure_ms).pixels, eye.read(exposure_ms, pair=True).pixels


def capture_ramps(eye: Eye, unit_ms: float, black_dn: float) -> Readings:
    """White, red, green and blue from full drive down, exposed longer the darker they are."""
    for leds in RAMPS.values():
        units, before = 1, RAMP_LEVELS[0]
        rate = 0.0
        for level in RAMP_LEVELS:
            if rate:
                predicted = rate * (level / before) ** _GUESSED_GAMMA * unit_ms
                units = int(np.clip(_RAMP_AIM * eye.full_scale_dn / predicted, 1, _LONGEST_UNITS))
            eye.show((level * leds[0], level * leds[1], level * leds[2]))
            _pair(eye, units * unit_ms)
            rate = max(eye.last_mean_dn - black_dn, 1.0) / (units * unit_ms)
            before = level
    return eye.collect()


def capture_series(eye: Eye, unit_ms: float, black_dn: float, white_rate: float) -> tuple[Readings, Readings]:
    """Pairs at rising exposures of one grey, and frames that clip."""
    eye.show(find_level(eye, black_dn, white_rate, _FULL_UNITS * unit_ms, _FULL_AIM))
    for units in _SERIES_UNITS:
        _pair(eye, units * unit_ms)
    series = eye.collect()
    eye.show(grey(1.0))
    _pair(eye, _SERIES_UNITS[-1] * unit_ms)
    return series, eye.collect()


def capture_beat(
    eye: Eye, exposures_ms: tuple[float, ...], black_dn: float, white_rate: float, rng: np.random.Generator
) -> Readings:
    """Repeats at irregular times at each exposure."""
    eye.show(find_level(eye, black_dn, white_rate, max(exposures_ms)))
    for exposure_ms, gap_ms in product(exposures_ms, rng.uniform(*_GAPS_MS, _REPEATS)):
        eye.read(exposure_ms, gap_ms)
    return eye.collect()


def capture_bars(eye: Eye, unit_ms: float, black_dn: float, white_rate: float) -> BarFrames:
    """Bars and their inverse, two frames each."""
    drive = find_level(eye, black_dn, white_rate, unit_ms)
    info = eye.devices.projector.info
    taken: list[Frames] = []
    for inverse in (False, True):
        row = bar_levels(info.width_px, drive[0], inverse)
        eye.show_image(np.repeat(row[None], info.height_px, 0), drive)
        taken.append((eye.snap(unit_ms).pixels, eye.snap(unit_ms).pixels))
    return BarFrames(taken[0], taken[1])
