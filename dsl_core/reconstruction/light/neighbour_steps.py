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
from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import raw_variance
from dsl_core.reconstruction.light.line_levels import pitch_of, zone_px
from dsl_core.reconstruction.light.setting_ratios import compared_rows

Floats = NDArray[np.float64]
Picture = NDArray[np.float32]

#: Pixels away from lines that tell anything.
FEWEST = 60
#: Differences of pixels count up to so many deviations: a highlight is no change of black.
CLIP = 4.0
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

    ``black_dn`` in every pixel; ``log`` of its light, from which ``shared_dn`` of light, the mean that both
    frames hold in the pixels asked (infinite for pictures of a code), was asked; with deviations.
    """

    black_dn: Floats
    black_std_dn: Floats
    log: Floats
    log_std: Floats
    shared_dn: Floats


def neighbour_steps(scan: Scan, column: NDArray[np.integer]) -> NeighbourSteps:
    """Compare neighbouring frames of a scan whose pixels have these projector columns (negative: none)."""
    found = NeighbourSteps(*(np.full(scan.plan.shot_count, np.nan) for _ in range(5)))
    for setting in range(len(scan.plan.settings)):
        if setting in scan.plan.code_settings and not isinstance(scan.plan.code, NoCode | CapturedCode):
            _of_code(scan, setting, found)
        if isinstance(scan.plan.spectral, ScanLines):
            _of_lines(scan, scan.plan.spectral, setting, column, found)
    return found


def pair_against_white(scan: Scan, setting: int, number: int) -> tuple[tuple[float, float], ...]:
    """The light of a pair of the code over that of white, as a logarithm, and its black less black, DN.

    Each with its deviation; black is that of one picture.
    """
    sensor = scan.rig.sensor
    white, black = (_read(scan, _shot(scan, role, 0, setting)) for role in ("white", "black"))
    one, other = (_read(scan, _shot(scan, "code", 2 * number + i, setting)) for i in (0, 1))
    sound = np.maximum(np.maximum(one, other), white) < 0.98 * sensor.full_scale_dn
    light, both = (white - black)[sound].astype(np.float64), (one + other - 2 * black)[sound]
    if sound.sum() < FEWEST or light.std() == 0:
        return ((np.nan, np.nan), (np.nan, np.nan))
    (slope, offset), covariance = np.polyfit(light, both, 1, cov=True)
    stds = np.sqrt(np.diag(covariance))
    slope = max(float(slope), 1e-3)
    return (float(np.log(slope)), float(stds[0]) / slope), (float(offset) / 2, float(stds[1]) / 2)


def _of_code(scan: Scan, setting: int, found: NeighbourSteps) -> None:
    """Pairs of the code, then white, each against the one before."""
    last = ((0.0, 0.0), (0.0, 0.0))
    for number in reversed(range(scan.plan.code_count // 2)):
        own = pair_against_white(scan, setting, number)
        after = scan.plan.code_count == 2 * (number + 1)
        shot = _shot(scan, "white", 0, setting) if after else _shot(scan, "code", 2 * number + 2, setting)
        (light, light_std), (black, black_std) = (
            (then[0] - now[0], float(np.hypot(then[1], now[1]))) for then, now in zip(last, own, strict=True)
        )
        found.log[shot.index], found.log_std[shot.index] = light, light_std
        found.black_dn[shot.index], found.black_std_dn[shot.index] = black, black_std
        found.shared_dn[shot.index] = np.inf
        last = own


def _of_lines(
    scan: Scan, lines: ScanLines, setting: int, column: NDArray[np.integer], found: NeighbourSteps
) -> None:
    """Lines, each against the one before."""
    sensor, rows = scan.rig.sensor, compared_rows(column.shape[0])
    black = _read(scan, _shot(scan, "black", 0, setting))
    columns, zone = column[rows].astype(np.float64), zone_px(lines, pitch_of(column))
    noise = raw_variance(sensor, black - sensor.black_level_dn)
    whites = [shot for shot in scan.shots_of("white", 0) if shot.setting == setting]
    unlit = columns < 0
    if whites:
        unlit &= _read(scan, whites[0]) - black < UNLIT * np.sqrt(2 * noise)
    before: Picture | None = None
    for pattern in range(scan.plan.spectral_count):
        shot = _shot(scan, "spectral", pattern, setting)
        now, centre = _read(scan, shot), pattern * lines.step_px + lines.width_px / 2
        if before is not None:
            away = np.abs(columns - (centre - lines.step_px / 2)) > zone + lines.step_px / 2
            away = (away & (columns >= 0)) | unlit
            if int(away.sum()) >= FEWEST:
                _compare(shot.index, before[away], now[away], black[away], noise[away], found)
        before = now


def _compare(
    at: int, before: Picture, now: Picture, black: Picture, noise: Picture, found: NeighbourSteps
) -> None:
    deviation = np.sqrt(2 * noise)
    more = now - before
    middle = np.median(more)
    mean = float(middle + np.clip(more - middle, -CLIP * deviation, CLIP * deviation).mean())
    std = float(np.sqrt((deviation**2).sum(dtype=np.float64)) / len(more))
    shared = float((before - black).mean())
    found.black_dn[at], found.black_std_dn[at], found.shared_dn[at] = mean, std, shared


def _shot(scan: Scan, role: Role, pattern: int, setting: int) -> Shot:
    return next(shot for shot in scan.shots_of(role, pattern) if shot.setting == setting)


def _read(scan: Scan, shot: Shot) -> Picture:
    """Rows of a frame that are looked at."""
    frame = scan.source.read(shot)
    return np.asarray(frame[compared_rows(frame.shape[0])], np.float32)
