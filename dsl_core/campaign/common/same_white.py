"""Whether a scan was exposed as the test shot before it: both saw white, and nothing was touched between.

A scan whose pictures are all too dark or too bright is right in itself; only the test shot, at an exposure of
its own, contradicts it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.common.white_shot import WhiteLevel
from dsl_core.errors import CalibrationError
from dsl_core.model.base import Record
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import ScanLines, Shot

NOTE_NAME = "white.json"
#: How far the light of white may be from that of the test shot at the same drive level, and at another one
#: before the self-test has measured how light follows the level. An exposure of one colour cycle is less
#: exact than those of many.
SAME_LEVEL, OTHER_LEVEL = 0.12, 0.35
#: Drive levels that are the same.
SAME = 0.01
#: Share of saturated pixels from which on white says nothing.
MOST_SATURATED = 0.01
#: Tiles along either side of a picture: a line and its orders light fewer than half of all, however the
#: camera is turned.
TILES = 16
#: Share of values more than a deviation below their mean; how much noisier a median is than a mean.
ONE_SIGMA_BELOW, MEDIAN_NOISE = 0.159, 1.25
#: What one picture of black is off by, times the lines it is taken off, as a share of their light: beyond it
#: lamps that flicker would decide whether white is the same.
MOST_OF_BLACK = 0.02
#: So many deviations of noise are granted on top: one picture of black is taken off all faint lines.
NOISE_SIGMAS = 3.0


class WhiteNote(Record):
    """White of a test shot: mean DN per ms at full drive, and the drive level of its picture."""

    mean_dn_per_ms: float
    level: float


def keep_white(bench: Bench, step: Step, white: WhiteLevel) -> None:
    """Note in a step's folder what the test shot saw; raises `StoreError`."""
    if not white.saturated:
        note = WhiteNote(mean_dn_per_ms=float(white.picture.mean()), level=white.level)
        bench.keep(step, NOTE_NAME, note)


def require_same_white(bench: Bench, step: Step) -> None:
    """Raise `CalibrationError` where white of a step's scan has other light than in its test shot.

    Nothing is said of captures without a test shot, and of white that saturates.
    """
    if not (bench.step_folder(step) / NOTE_NAME).exists():
        return
    note, scan = bench.kept(step, NOTE_NAME, WhiteNote), bench.scan_of(step)
    shot, seen_dn, noise_dn = _white_of(scan, bench.rig.sensor.full_scale_dn)
    if shot is None or note.mean_dn_per_ms <= 0:
        return
    response = bench.rig.projector_response
    light = float(response.radiance(shot.level) - response.radiance(0.0))
    expected_dn = shot.exposure_ms * light * note.mean_dn_per_ms
    share = seen_dn / expected_dn
    start = bench.devices.nominal or bench.devices.calibration
    knows_levels = start is not None and start.projector_response != bench.rig.projector_response
    is_close = knows_levels or abs(shot.level - note.level) < SAME
    noise = NOISE_SIGMAS * noise_dn / expected_dn
    if abs(share - 1) > (SAME_LEVEL if is_close else OTHER_LEVEL) + noise:
        raise CalibrationError(
            f"{step.title}: white of the scan has {share:.2f} times the light for its exposure that it had in"
            " the test shot before. The camera exposed for another time than requested, or light or gain"
            " changed, or light of the room came on, or the camera's values are not proportional to the"
            " light: switch its automatic exposure, gain and gamma and the projector's eco mode off,"
            " keep the room dark, let the projector warm up, and capture the step again."
        )


def _white_of(scan: FrameSource, full_scale_dn: float) -> tuple[Shot | None, float, float]:
    """A shot like white's in the first setting of a scan, its mean above black and noise, DN; None if untold.

    Without a picture of white, lines that tile the frame are white together.
    """
    shots = [shot for shot in scan.plan.shots() if shot.setting == 0]
    black = next((shot for shot in shots if shot.role == "black"), None)
    whites = [shot for shot in shots if shot.role == "white"][:1]
    lines = scan.plan.spectral
    if not whites and isinstance(lines, ScanLines) and lines.step_px == lines.width_px and not lines.sparse:
        whites = [shot for shot in shots if shot.role == "spectral"]
    if black is None or not whites:
        return None, 0.0, 0.0
    dark, above = scan.read(black), []
    for shot in whites:
        pixels = scan.read(shot)
        if float((pixels >= full_scale_dn).mean()) > MOST_SATURATED:
            return None, 0.0, 0.0
        above.append(_above(pixels, dark))
    return whites[0], *_light_of(np.array(above))


def _above(pixels: NDArray[np.uint16], dark: NDArray[np.uint16]) -> tuple[float, float, float]:
    """What a picture shows above black, DN: mean of all pixels, of tiles which no line lights, and noise.

    Noise is the deviation of a mean of all tiles, by those darker than the median, which no halo lights.
    """
    above = np.subtract(pixels, dark, dtype=np.float64)
    tiles = [tile.mean() for row in np.array_split(above, TILES) for tile in np.array_split(row, TILES, 1)]
    darker, unlit = np.quantile(tiles, (ONE_SIGMA_BELOW, 0.5)).tolist()
    return float(above.mean()), unlit, (unlit - darker) / TILES


def _light_of(above: NDArray[np.float64]) -> tuple[float, float]:
    """Light of pictures that are white together, and its noise, DN, from `_above` of each (pictures, 3).

    One picture of black is taken off all of them. Where lamps flicker, each has its own black, which its
    unlit tiles show, with a little halo.
    """
    total, unlit, noise = float(above[:, 0].sum()), above[:, 1], float(np.median(above[:, 2]))
    noise_dn = noise * len(above) / np.sqrt(2)
    if len(above) < 3:
        return total, noise_dn
    unsteady = np.sqrt(max(float(np.var(np.diff(unlit))) / 2 - (MEDIAN_NOISE * noise) ** 2, 0.0))
    if unsteady * len(above) <= MOST_OF_BLACK * abs(total):
        return total, noise_dn
    return total - float(unlit.sum()), noise_dn
