"""Frames whose values end below full scale while those of other frames do not.

A driver that was set otherwise in the middle of a scan, or between two parts of it, leaves frames that are
cut off at a value of their own. What `own_sensor` learns of all frames together says nothing of these.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.frames import FrameSource, read_rows
from dsl_core.model.plan import CapturePlan, Shot, spoken_number
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import bayer_channels
from dsl_core.words import counted

Mosaic = NDArray[np.uint16]

#: Where values of a frame end, as many pixels have the last one, so many times as many as those below it on
#: average, and so many times as many as any of those: light that is rounded comes in steps as well.
PILE, TIMES, TIMES_EACH = 30, 10.0, 4.0
#: Each of several colours has at least this share of them: noise-free light piles up in one alone.
OTHER_COLOUR = 0.1
#: Ends are looked for above this share of the range; nearer to full scale than this they count anyway.
UPPER, MARGIN = 0.25, 0.02
#: Pixels above the end, as a share of those at it: hot pixels.
ABOVE = 0.01


class EarlyEnds:
    """A `FrameSource` in which pixels at the end of such a frame's values have those of full scale."""

    def __init__(self, source: FrameSource, sensor: Sensor) -> None:
        """``sensor`` says where the values of all other frames end; the source stays the caller's."""
        self._source, self._sensor = source, sensor
        #: Where the values of a frame end, by the index of its shot; None at full scale.
        self._ends: dict[int, int | None] = {}

    @property
    def plan(self) -> CapturePlan:
        """The plan the frames belong to."""
        return self._source.plan

    def read(self, shot: Shot) -> Mosaic:
        """The raw mosaic of a shot, shape (rows, columns); raises `StoreError` when it is not there."""
        pixels = self._source.read(shot)
        if shot.index not in self._ends:
            self._ends[shot.index] = end_of_values(pixels, self._sensor)
        return self._lifted(pixels, self._ends[shot.index])

    def read_rows(self, shot: Shot, rows: slice) -> Mosaic:
        """Some rows of it; raises `StoreError`."""
        pixels = read_rows(self._source, shot, rows)
        end = self._ends.get(shot.index)
        if end is None and shot.index not in self._ends:
            end = end_of_values(pixels, self._sensor, rows.start or 0)
        return self._lifted(pixels, end)

    @property
    def findings(self) -> tuple[FitFinding, ...]:
        """What the frames that were read so far say to a person."""
        ends = {at: end for at, end in sorted(self._ends.items()) if end is not None}
        if not ends:
            return ()
        first, full_dn = min(ends), self._sensor.full_scale_dn
        lowest = min(ends.values())
        more = "" if len(ends) == 1 else f", and of {counted(len(ends) - 1, 'other frame')},"
        return (
            FitFinding.judged(
                "response",
                "saturation of single frames",
                1 - lowest / full_dn,
                "1",
                MARGIN,
                f"Values of frame {spoken_number(first)}{more} end at {lowest} DN or more, below the"
                f" {full_dn} DN of the camera and unlike those of other frames; pixels that reach the end"
                " count as saturated.",
                "Leave gain, bit depth and limits of the camera's driver as they were, and scan again.",
            ),
        )

    def _lifted(self, pixels: Mosaic, end: int | None) -> Mosaic:
        if end is None:
            return pixels
        return np.where(pixels >= end, np.uint16(self._sensor.full_scale_dn), pixels)


def end_of_values(pixels: Mosaic, sensor: Sensor, first_row: int = 0) -> int | None:
    """The value at which a mosaic (rows, columns) ends; None if at full scale, or not told.

    ``first_row`` is which row of the picture it begins with. Noise spreads light over neighbouring values,
    and colours differ: only where values end do many pixels of several colours have the same one.
    """
    limit = (1 - MARGIN) * sensor.full_scale_dn
    most = int(pixels.max(initial=0))
    low = sensor.black_level_dn + UPPER * (sensor.full_scale_dn - sensor.black_level_dn)
    if most <= low:
        return None
    if most >= limit:
        full = pixels >= limit
        if int(full.sum()) > ABOVE * pixels.size:
            return None
        below = pixels[~full]
        most = int(below.max(initial=0))
    return most if most > low and _is_end(pixels, most, sensor, first_row) else None


def _is_end(pixels: Mosaic, end: int, sensor: Sensor, first_row: int) -> bool:
    """Whether many pixels have this value, of several colours if any, few those next to it, and none more."""
    at_end = pixels == end
    pile = int(at_end.sum())
    if pile < PILE or int((pixels > end).sum()) > ABOVE * pile:
        return False
    first = max(end - max(end // 100, 8), 0)
    near = pixels[(pixels >= first) & ~(pixels >= end)]
    below = np.bincount(near - first, minlength=end - first)
    if pile < TIMES * below.mean() or pile < TIMES_EACH * below.max():
        return False
    channels = bayer_channels(sensor.bayer, pixels.shape[0] + first_row % 2, pixels.shape[1])[first_row % 2 :]
    colours = np.sort(np.bincount(channels[at_end], minlength=3))
    return bool(colours[1] >= OTHER_COLOUR * pile or sensor.bayer == "MONO")
