"""Whether planes on a stage are flat and stand where the stage says: what is refused, and by which name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import ColumnSamples
from dsl_core.errors import CalibrationError

Floats = NDArray[np.float64]

#: Tiles a position needs.
MIN_TILES = 30
#: What a stage or a plane may be off (mm) before it is taken as wrong, and by how much a stage's scale.
MAX_STEP_ERROR_MM, MAX_PLANE_RMS_MM, MAX_SCALE_ERROR = 0.3, 0.3, 0.02
#: What a board leaves open of the scale, and how many times less flat than others a wrong plane is.
UNSURE_SCALE, LESS_FLAT = 0.002, 2.0
#: How far planes may pull the geometry, in its own deviations (rms).
MAX_PULL = 4.0


def require_tiles(positions_mm: Sequence[float], samples: Sequence[ColumnSamples]) -> None:
    """Raise `CalibrationError` unless there are two positions with enough tiles each."""
    if len(samples) < 2:
        raise CalibrationError(
            f"The depth stage needs a plane at two or more positions, given {len(samples)}. Add positions."
        )
    for position, part in zip(positions_mm, samples, strict=True):
        if len(part) < MIN_TILES:
            raise CalibrationError(
                f"At the stage's position {position:g} mm only {len(part)} tiles of the image show"
                f" columns of the projector; {MIN_TILES} are needed. Check that the plane fills the view."
            )


def require_steps(positions_mm: Sequence[float], distances_mm: Floats) -> float:
    """How many times as far apart as the stage says the planes stand by the geometry before it is refined.

    Raises `CalibrationError` when that is far from one, or one of them stands elsewhere.
    """
    positions = np.asarray(positions_mm, float)
    tolerance = MAX_STEP_ERROR_MM + UNSURE_SCALE * float(np.ptp(positions))
    rise, offset = np.polyfit(positions - positions.mean(), distances_mm, 1)
    bent = np.abs(distances_mm - offset - rise * (positions - positions.mean())).max() > tolerance
    off = distances_mm - positions
    off -= np.median(off)
    worst = int(np.abs(off).argmax())
    if bent and abs(off[worst]) > tolerance:
        raise CalibrationError(
            f"The plane at the stage's position {positions[worst]:g} mm stands {off[worst]:+.2f} mm from"
            " where the other positions say it should. Check that the stage reached it and that nothing else"
            " moved, that all was captured with this rig, and take this position again."
        )
    if abs(rise - 1) > MAX_SCALE_ERROR:
        raise CalibrationError(
            f"The planes are {rise:.3f} times as far apart as the stage's positions"
            f" {', '.join(f'{p:g}' for p in positions)} mm. Check the unit of the stage, that it moves along"
            " the camera's axis, and the printed size of the board that the geometry was calibrated with."
        )
    return float(rise)


def require_alike(positions_mm: Sequence[float], rms_mm: Floats) -> None:
    """Raise `CalibrationError` naming a position that is far less flat than the others.

    Before the geometry is refined it bends planes, but all alike.
    """
    require_flat(positions_mm, rms_mm, MAX_PLANE_RMS_MM + LESS_FLAT * float(np.median(rms_mm)))


def require_flat(positions_mm: Sequence[float], rms_mm: Floats, limit_mm: float = MAX_PLANE_RMS_MM) -> None:
    """Raise `CalibrationError` naming the position whose points scatter too far about their plane."""
    worst = int(rms_mm.argmax())
    if rms_mm[worst] > limit_mm:
        raise CalibrationError(
            f"The points at the stage's position {positions_mm[worst]:g} mm lie"
            f" {rms_mm[worst]:.2f} mm rms off a plane; {limit_mm:.2g} mm are allowed. Use a"
            " flat target that fills the view, and check that all positions were captured with this rig."
        )


def require_agreement(pull: float, bow_mm: float, bow_std_mm: float, rise: float) -> None:
    """Raise `CalibrationError` when planes would need other lenses than the board's, far beyond its doubts.

    A target that bulges alike at every position looks like lenses that distort otherwise, and steps that are
    all too long, by the ratio ``rise``, like devices that stand farther apart.
    """
    if pull > MAX_PULL:
        raise CalibrationError(
            f"The planes contradict the geometry calibration: it would have to move by {pull:.1f} of"
            f" its own standard deviations, {MAX_PULL:g} are allowed. Check that the target is flat: it looks"
            f" as if it bulged towards the camera by {bow_mm:.2f} ± {bow_std_mm:.2f} mm over 300 mm."
            f" By the printed board, the stage's steps are {rise:.3f} times as long as it says: check both."
            " Calibrate the geometry again if camera or projector were touched since."
        )
