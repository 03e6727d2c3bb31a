"""By how much light and black of a frame differ from the one before, whatever patterns these show.

Away from two neighbouring lines both frames hold the same: black, and the faint light of first orders, which
moves little. And pattern and inverse of a code are white and black together: from pixel to pixel their sum
is a multiple of that, above whatever black has gained.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, NoCode, Role, ScanLines, Shot
from dsl_core.model.rig import Rig, Sensor
from dsl_core.optics.sensor import raw_variance
from dsl_core.reconstruction.light.line_levels import pitch_of, zone_px
from dsl_core.reconstruction.light.setting_ratios import compared_rows

Floats = NDArray[np.float64]
Picture = NDArray[np.float32]
#: A figure and its deviation.
Seen = tuple[float, float]

#: Pixels away from lines that tell anything.
FEWEST = 60
#: Differences of pixels count up to so many deviations: a highlight is no change of black.
CLIP = 4.0
#: Variance of light over a picture, relative to that of noise, that tells by how much all of it changed.
CONTRAST = 10.0
#: Pixels without a column are unlit with less light than so many deviations.
UNLIT = 3.0


class Scan(Protocol):
    """What is read of a scan."""

    source: FrameSource
    rig: Rig
    plan: CapturePlan

    def shots_of(self, role: Role, pattern: int) -> list[Shot]:
        """The shots of a pattern, one for each setting it was captured with."""


@dataclass(frozen=True)
class NeighbourSteps:
    """What each shot has more than the one before, all (shots,), NaN where that is not known.

    ``black_dn`` is the mean over pixels that no line is near, where black is ``dark_dn`` above its level and
    the frame before held ``faint_dn`` of light.
    ``light_dn`` is the same with pixels that are bright in white counting more; there the frame before held
    ``shared_dn`` of light, and black is ``light_dark_dn`` above its level. Pictures of a code tell the
    logarithm ``log`` of their light at once. With deviations.
    """

    black_dn: Floats
    black_std_dn: Floats
    dark_dn: Floats
    faint_dn: Floats
    light_dn: Floats
    light_std_dn: Floats
    shared_dn: Floats
    light_dark_dn: Floats
    log: Floats
    log_std: Floats


def neighbour_steps(scan: Scan, column: NDArray[np.integer]) -> NeighbourSteps:
    """Compare neighbouring frames of a scan whose pixels have these projector columns (negative: none)."""
    found = NeighbourSteps(*(np.full(scan.plan.shot_count, np.nan) for _ in range(10)))
    for setting in range(len(scan.plan.settings)):
        if setting in scan.plan.code_settings and not isinstance(scan.plan.code, NoCode | CapturedCode):
            _of_code(scan, setting, found)
        if isinstance(scan.plan.spectral, ScanLines):
            _of_lines(scan, scan.plan.spectral, setting, column, found)
    return found


def pair_against_white(scan: Scan, setting: int, number: int) -> tuple[Seen, Seen]:
    """The light of a pair of the code over that of white, as a logarithm, and its black less black, DN.

    Each with its deviation; black is that of one picture.
    """
    sensor = scan.rig.sensor
    white, black = (_read(scan, _shot(scan, role, 0, setting)) for role in ("white", "black"))
    one, other = (_read(scan, _shot(scan, "code", 2 * number + i, setting)) for i in (0, 1))
    sound = np.maximum(np.maximum(one, other), white) < 0.98 * sensor.full_scale_dn
    light, both = (each[sound].astype(np.float64) for each in (white - black, one + other - 2 * black))
    if light.size < FEWEST:
        return ((np.nan, np.nan), (np.nan, np.nan))
    # Noise of white and black would flatten the slope.
    noise = [
        float(raw_variance(sensor, each[sound] - sensor.black_level_dn).mean()) for each in (white, black)
    ]
    power = float(light.var()) - sum(noise)
    if power < CONTRAST * sum(noise):
        return ((np.nan, np.nan), (np.nan, np.nan))
    slope = max((float(np.mean((light - light.mean()) * both)) - 2 * noise[1]) / power, 1e-3)
    left = both - slope * light
    std = float(left.std()) / np.sqrt(light.size)
    slope_std = std / np.sqrt(power)
    offset = float(left.mean()) / 2, float(np.hypot(std, slope_std * light.mean())) / 2
    return (float(np.log(slope)), slope_std / slope), offset


def _of_code(scan: Scan, setting: int, found: NeighbourSteps) -> None:
    """Pairs of the code, then white, each against the one before."""
    last: tuple[Seen, Seen] = ((0.0, 0.0), (0.0, 0.0))
    for number in reversed(range(scan.plan.code_count // 2)):
        own = pair_against_white(scan, setting, number)
        after = scan.plan.code_count == 2 * (number + 1)
        shot = _shot(scan, "white", 0, setting) if after else _shot(scan, "code", 2 * number + 2, setting)
        (light, light_std), (black, black_std) = (
            (then[0] - now[0], float(np.hypot(then[1], now[1]))) for then, now in zip(last, own, strict=True)
        )
        found.log[shot.index], found.log_std[shot.index] = light, light_std
        found.black_dn[shot.index], found.black_std_dn[shot.index] = black, black_std
        last = own


def _of_lines(
    scan: Scan, lines: ScanLines, setting: int, column: NDArray[np.integer], found: NeighbourSteps
) -> None:
    """Lines, each against the one before."""
    sensor, rows = scan.rig.sensor, compared_rows(column.shape[0])
    black = _read(scan, _shot(scan, "black", 0, setting))
    whites = [shot for shot in scan.shots_of("white", 0) if shot.setting == setting]
    light = _read(scan, whites[0]) - black if whites else np.ones_like(black)
    noise = raw_variance(sensor, black - sensor.black_level_dn)
    columns, zone = column[rows].astype(np.float64), zone_px(lines, pitch_of(column))
    known, unlit = columns >= 0, (columns < 0) & (light < UNLIT * np.sqrt(2 * noise))
    weights = np.maximum(light, 0) * known
    before: Picture | None = None
    for pattern in range(scan.plan.spectral_count):
        shot = _shot(scan, "spectral", pattern, setting)
        now, middle = _read(scan, shot), (pattern - 0.5) * lines.step_px + lines.width_px / 2
        if before is not None:
            from_line = columns - middle
            away = ((np.abs(from_line) > zone + lines.step_px / 2) & known) | unlit
            if int(away.sum()) >= FEWEST:
                dark = black[away] - np.float32(sensor.black_level_dn)
                pair = before[away], now[away]
                _compare_black(shot.index, *pair, black[away], noise[away], dark, found)
                _compare_light(shot.index, *pair, black[away], weights[away], sensor, dark, found)
        before = now


def _compare_black(
    at: int,
    before: Picture,
    now: Picture,
    black: Picture,
    noise: Picture,
    dark: Picture,
    found: NeighbourSteps,
) -> None:
    deviation = np.sqrt(2 * noise)
    more = now - before
    middle = np.median(more)
    found.black_dn[at] = middle + np.clip(more - middle, -CLIP * deviation, CLIP * deviation).mean()
    found.black_std_dn[at] = np.sqrt((deviation**2).sum(dtype=np.float64)) / len(more)
    found.dark_dn[at], found.faint_dn[at] = dark.mean(), (before - black).mean()


def _compare_light(
    at: int, before: Picture, now: Picture, black: Picture, weight: Picture, sensor: Sensor, dark: Picture,
    found: NeighbourSteps,
) -> None:  # fmt: skip
    total = float(weight.sum(dtype=np.float64))
    if total <= 0:
        return
    noise = raw_variance(sensor, before - sensor.black_level_dn)
    found.light_dn[at] = (weight * (now - before)).sum(dtype=np.float64) / total
    found.light_std_dn[at] = np.sqrt(2 * (weight**2 * noise).sum(dtype=np.float64)) / total
    found.shared_dn[at] = (weight * (before - black)).sum(dtype=np.float64) / total
    found.light_dark_dn[at] = (weight * dark).sum(dtype=np.float64) / total


def _shot(scan: Scan, role: Role, pattern: int, setting: int) -> Shot:
    return next(shot for shot in scan.shots_of(role, pattern) if shot.setting == setting)


def _read(scan: Scan, shot: Shot) -> Picture:
    """Rows of a frame that are looked at."""
    frame = scan.source.read(shot)
    return np.asarray(frame[compared_rows(frame.shape[0])], np.float32)
