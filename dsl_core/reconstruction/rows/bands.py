"""Bands of rows that a picture is divided into, and a scan that seems to be of some rows alone."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.frames import FrameSource, read_rows
from dsl_core.model.plan import CapturePlan, Shot

T = TypeVar("T")

#: Memory for the merged line frames of a band. Frames are decompressed by blocks of rows (64 of a full
#: sensor); those at the edge of a band are so once more for the next one.
BAND_BYTES = 320 << 20
#: Bytes of a value in one of them: radiance, and its deviation in half precision.
VALUE_BYTES = 6
#: Further rows on either side that belong to the neighbourhood of a band's pixels; even, as the mosaic is.
BESIDE = 4
#: Frames that a band counts at least, where few or no patterns follow the code.
FEWEST_FRAMES = 64


@dataclass(frozen=True)
class Band:
    """Some rows of a picture, and these with the neighbours that its pixels need."""

    rows: slice
    near: slice

    @property
    def own(self) -> slice:
        """Its rows among those with neighbours."""
        return slice(self.rows.start - self.near.start, self.rows.stop - self.near.start)


def bands_of(plan: CapturePlan, rows: int | None = None, multiple: int | None = 2) -> list[Band]:
    """Bands of equal height, as few as memory allows, or of at most so many ``rows``; the last may be longer.

    Their height is a ``multiple`` of that of what is worked on together; None: there is one band. The last
    one, whose frames are still there when spectra begin, takes what is left over where that fits.
    """
    width, height = plan.camera_size_px
    if multiple is None:
        return [Band(slice(0, height), slice(0, height))]
    fit = rows or BAND_BYTES // (width * VALUE_BYTES * max(plan.spectral_count, FEWEST_FRAMES)) - 2 * BESIDE
    starts = _starts(height, fit, multiple)
    return [
        Band(slice(start, stop), slice(max(start - BESIDE, 0), min(stop + BESIDE, height)))
        for start, stop in zip(starts, (*starts[1:], height), strict=True)
    ]


def _starts(height: int, fit: int, multiple: int) -> range:
    """First rows of the fewest bands that fit, whose height is a multiple of something."""
    parts, most = -(-height // multiple), max(fit // multiple, 1)
    for count in range(max(-(-height // max(fit, 1)), 1), parts):
        for step in (height // multiple // count, -(-parts // count)):
            start = (count - 1) * step * multiple
            if 0 < step <= most and 0 < height - start <= max(fit, multiple):
                return range(0, start + 1, step * multiple)
    return range(0, height, multiple)


@dataclass(frozen=True)
class RowsOf:
    """Some rows of a scan, as a `FrameSource`; its plan is that of the whole picture."""

    source: FrameSource
    rows: slice | NDArray[np.intp]

    @property
    def plan(self) -> CapturePlan:
        """The plan of the scan."""
        return self.source.plan

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """These rows of the raw mosaic of a shot."""
        if isinstance(self.rows, slice):
            return read_rows(self.source, shot, self.rows)
        return self.source.read(shot)[self.rows]


@dataclass(frozen=True)
class PixelsOf:
    """Some pixels (flat indices) of a scan, in a single row, as a `FrameSource`."""

    source: FrameSource
    pixels: NDArray[np.intp]

    @property
    def plan(self) -> CapturePlan:
        """The plan of the scan."""
        return self.source.plan

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """These pixels of the raw mosaic of a shot, (1, n)."""
        return self.of(self.source.read(shot))

    def of(self, mosaic: NDArray[np.uint16]) -> NDArray[np.uint16]:
        """These pixels of a whole mosaic, (1, n)."""
        return mosaic.ravel()[self.pixels][None]


def some_rows(record: T, rows: slice) -> T:
    """A record of maps (..., rows, columns), some of which may be None, of some rows of them."""
    maps = {field.name: getattr(record, field.name) for field in fields(record)}  # type: ignore[arg-type]
    return type(record)(**{name: None if map_ is None else map_[..., rows, :] for name, map_ in maps.items()})


def all_rows(parts: list[T]) -> T:
    """Records of maps one below the other."""
    if len(parts) == 1:
        return parts[0]
    joined = {}
    for field in fields(parts[0]):  # type: ignore[arg-type]
        maps = [getattr(part, field.name) for part in parts]
        joined[field.name] = None if maps[0] is None else np.concatenate(maps, axis=-2)
    return type(parts[0])(**joined)
