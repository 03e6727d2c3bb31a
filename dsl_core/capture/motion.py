"""What moved from one picture of a scan to another, by how much and where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import spoken_number
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import raw_variance
from dsl_core.solve.image_shift import TileShifts, tile_shifts

Floats = NDArray[np.float64]
Mosaic = NDArray[np.uint16]

#: Tiles of the picture, down and across.
TILES = (4, 6)
#: A tile has moved by at least so many camera pixels and deviations; one that changed has lost this share.
LEAST_PX, SIGMAS, CHANGED = 0.2, 6.0, 0.25
#: Tiles that tell a shift to this many pixels count; so many of them must have moved, or all but few.
TELLING_PX, FEWEST = 0.1, 2
#: Something moved for sure if a shift explains at least this share of what changed in one of the tiles:
#: filters that sharpen, mixed pictures and other colours move edges of stripes, but change more than that.
EXPLAINED = 0.6
#: From this share of the telling tiles on, all of the picture moved.
MOST = 0.6


@dataclass(frozen=True)
class Movement:
    """What moved: ``shift_px`` camera pixels (median of the moved tiles) between two shots of the plan.

    None: the picture changed, but by no shift; as shots: at some time since the scan began.
    ``is_pattern``: the picture stayed, but the pattern on it moved. ``columns`` and ``rows`` bound what
    moved, camera pixels; None for all of the picture. Unless it ``is_sure``, more has changed everywhere than
    a shift explains.
    """

    after: int | None
    before: int | None
    shift_px: float | None
    std_px: float
    is_pattern: bool
    columns: tuple[int, int] | None = None
    rows: tuple[int, int] | None = None
    is_sure: bool = True

    @property
    def sentence(self) -> str:
        """What moved, by how much and when."""
        when = "since the scan began"
        if self.before is not None and self.after is not None:
            when = f"between frame {spoken_number(self.after)} and frame {spoken_number(self.before)}"
        part = ""
        if self.columns is not None and self.rows is not None:
            part = " in columns {}-{}, rows {}-{} of the picture".format(*self.columns, *self.rows)
        if self.shift_px is None:
            return f"The scene changed{part}, {when}, by more than a small motion."
        if not self.is_sure:
            return (
                f"The picture changed{part}, {when}, and a motion explains only a part of it: camera or"
                " projector sharpen, filter or mix pictures, light or colours of the projector are others,"
                " or something moved."
            )
        size = f"{self.shift_px:.1f} ± {max(self.std_px, 0.1):.1f} px"
        if self.is_pattern:
            return (
                f"The pattern moved by {size} on the scene{part}, {when}: the projector moved, or the"
                " distance of an object changed."
            )
        what = "The camera or the scene" if self.columns is None else "Something"
        return f"{what} moved by {size}{part}, {when}."

    @property
    def advice(self) -> str:
        """What to do about it."""
        first = "Fix camera, projector and scene"
        if not self.is_sure:
            first = "Switch what improves pictures off in camera, projector and computer, fix all of them"
        return f"{first}, and scan again; frames after that do not fit those before."


def moved_between(
    before: tuple[Mosaic, Mosaic], now: tuple[Mosaic, Mosaic], sensor: Sensor, is_pattern: bool
) -> Movement | None:
    """What moved from one picture to the other, each with a black one (raw mosaics, DN); None: nothing did.

    Light that changes all over the picture, and light of the room, do not matter. ``is_pattern`` says that
    the pictures show a pattern, white otherwise.
    """
    (old, old_variance), (new, variance) = (_light(*pair, sensor) for pair in (before, now))
    return _movement(tile_shifts(old, new, old_variance + variance, TILES), old.shape, is_pattern)


def _light(picture: Mosaic, black: Mosaic, sensor: Sensor) -> tuple[Floats, Floats]:
    """Light of a picture over its black, means over 2 x 2 pixels, and its variance."""
    lit, dark = (np.add.reduce(_quarters(each), dtype=np.float64) / 4 for each in (picture, black))
    # The noise of counts is linear in light, so that of four is known by their mean.
    levels = (raw_variance(sensor, each - sensor.black_level_dn) for each in (lit, dark))
    noise = np.add.reduce(list(levels)) / 4
    clipped = np.maximum.reduce(_quarters(picture)) >= 0.98 * sensor.full_scale_dn
    return np.asarray(lit - dark), np.where(clipped, 1e12, noise)


def _quarters(picture: Mosaic) -> list[Mosaic]:
    """The pixels of every block of 2 x 2, one array (rows / 2, columns / 2) for each place in it."""
    rows, columns = (size // 2 * 2 for size in picture.shape)
    return [picture[down:rows:2, across:columns:2] for down in (0, 1) for across in (0, 1)]


def _movement(found: TileShifts, shape: tuple[int, ...], is_pattern: bool) -> Movement | None:
    std = np.maximum(found.x_std, found.y_std)
    telling = 2 * std < TELLING_PX
    moved = telling & (2 * found.length > LEAST_PX) & (found.sigmas > SIGMAS)
    moved |= found.change > CHANGED
    if moved.sum() < FEWEST:
        return None
    sure = moved & telling
    whole = moved.sum() >= MOST * max(int(telling.sum()), FEWEST)
    rows, columns = (
        _span(np.asarray(moved.any(axis)), 2 * size) for axis, size in ((1, shape[0]), (0, shape[1]))
    )
    return Movement(
        after=None,
        before=None,
        shift_px=float(np.median(2 * found.length[sure])) if sure.any() else None,
        std_px=float(2 * np.median(std[sure])) if sure.any() else 0.0,
        is_pattern=is_pattern,
        columns=None if whole else columns,
        rows=None if whole else rows,
        is_sure=bool((found.explained[sure] >= EXPLAINED).any()) or not sure.any(),
    )


def _span(moved: NDArray[np.bool_], size: int) -> tuple[int, int]:
    at = np.flatnonzero(moved)
    return int(at[0] * size / len(moved)), int((at[-1] + 1) * size / len(moved))
