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
#: What one picture of black is off by, times the lines it is taken off, as a share of their light: beyond it
#: lamps that flicker would decide whether white is the same.
MOST_OF_BLACK = 0.02


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
    shot, seen_dn = _white_of(scan, bench.rig.sensor.full_scale_dn)
    if shot is None or note.mean_dn_per_ms <= 0:
        return
    response = bench.rig.projector_response
    light = float(response.radiance(shot.level) - response.radiance(0.0))
    share = seen_dn / (shot.exposure_ms * light) / note.mean_dn_per_ms
    start = bench.devices.nominal or bench.devices.calibration
    knows_levels = start is not None and start.projector_response != bench.rig.projector_response
    is_close = knows_levels or abs(shot.level - note.level) < SAME
    if abs(share - 1) > (SAME_LEVEL if is_close else OTHER_LEVEL):
        raise CalibrationError(
            f"{step.title}: white of the scan has {share:.2f} times the light for its exposure that it had in"
            " the test shot before. The camera exposed for another time than requested, or light or gain"
            " changed, or light of the room came on, or the camera's values are not proportional to the"
            " light: switch its automatic exposure, gain and gamma and the projector's eco mode off,"
            " keep the room dark, let the projector warm up, and capture the step again."
        )


def _white_of(scan: FrameSource, full_scale_dn: float) -> tuple[Shot | None, float]:
    """A shot like white's in the first setting of a scan, and its mean above black, DN; None if untold.

    Without a picture of white, lines that tile the frame are white together.
    """
    shots = [shot for shot in scan.plan.shots() if shot.setting == 0]
    black = next((shot for shot in shots if shot.role == "black"), None)
    whites = [shot for shot in shots if shot.role == "white"][:1]
    lines = scan.plan.spectral
    if not whites and isinstance(lines, ScanLines) and lines.step_px == lines.width_px and not lines.sparse:
        whites = [shot for shot in shots if shot.role == "spectral"]
    if black is None or not whites:
        return None, 0.0
    dark, above = scan.read(black), []
    for shot in whites:
        pixels = scan.read(shot)
        if float((pixels >= full_scale_dn).mean()) > MOST_SATURATED:
            return None, 0.0
        above.append(_above(pixels, dark))
    return whites[0], _light_of(np.array(above))


def _above(pixels: NDArray[np.uint16], dark: NDArray[np.uint16]) -> tuple[float, float]:
    """What a picture shows above black, DN: mean of all pixels, and that of tiles which no line lights."""
    above = np.subtract(pixels, dark, dtype=np.float64)
    tiles = [tile.mean() for row in np.array_split(above, TILES) for tile in np.array_split(row, TILES, 1)]
    return float(above.mean()), float(np.median(tiles))


def _light_of(above: NDArray[np.float64]) -> float:
    """Light of pictures that are white together, DN, from `_above` of each (pictures, 2).

    One picture of black is taken off all of them. Where lamps flicker, each has its own black, which its
    unlit tiles show, with a little halo.
    """
    total, unlit = float(above[:, 0].sum()), above[:, 1]
    if len(above) < 3:
        return total
    unsteady = float(np.std(np.diff(unlit))) / np.sqrt(2)
    if unsteady * len(above) <= MOST_OF_BLACK * abs(total):
        return total
    return total - float(unlit.sum())
