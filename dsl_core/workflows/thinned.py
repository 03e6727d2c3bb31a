"""Pictures of another program with fewer pixels, and how many of those a mapping lets decode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.pictures.source import PictureScan
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.result import Flag
from dsl_core.progress import Progress
from dsl_core.workflows.captures import decode_columns_of, sensor_of

#: Pixels that are enough to judge a mapping by.
PREVIEW_PIXELS = 120_000


@dataclass(frozen=True)
class Thinned:
    """A `FrameSource` of every so many blocks of 2 x 2 pixels, so that a mosaic stays one."""

    source: PictureScan
    step: int

    @property
    def plan(self) -> CapturePlan:
        """The plan, for fewer pixels."""
        plan = self.source.plan
        width, height = (len(kept(size, self.step)) for size in plan.camera_size_px)
        return plan.model_copy(update={"camera_size_px": (width, height)})

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """A frame of fewer pixels."""
        frame = self.source.read(shot)
        height, width = frame.shape
        return np.ascontiguousarray(frame[kept(height, self.step)][:, kept(width, self.step)])


def kept(size: int, step: int) -> NDArray[np.intp]:
    """Places that are left of a row of so many pixels.

    >>> kept(10, 3).tolist()
    [0, 1, 6, 7]
    """
    return np.flatnonzero(np.arange(size) // 2 % step == 0)


def thinned(source: PictureScan) -> Thinned:
    """The pictures with at most about `PREVIEW_PIXELS`."""
    width, height = source.plan.camera_size_px
    return Thinned(source, max(int(np.ceil(np.sqrt(width * height / PREVIEW_PIXELS))), 1))


def decided_share(source: PictureScan, progress: Progress | None = None) -> float:
    """Share (0 to 1) of the lit pixels whose column, or else row, can be read; NaN where none is lit.

    Raises `StoreError` naming the picture that cannot be used, `DecodeError` when the code cannot be read.
    """
    result = decode_columns_of(thinned(source), sensor_of(source), progress)
    name = "column_px" if np.isfinite(result["column_px"].values).any() else "row_px"
    lit = (result["flags"].values & int(Flag.NO_LIGHT)) == 0
    known = np.isfinite(result[name if name in result else "column_px"].values)
    return float(known[lit].mean()) if lit.any() else float("nan")
