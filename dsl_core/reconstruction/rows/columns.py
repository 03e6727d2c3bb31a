"""Columns of a picture whose frames come by rows."""

from __future__ import annotations

from dsl_core.model.options import Options
from dsl_core.model.rig import Rig
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import Progress
from dsl_core.reconstruction.geometry import ColumnSearch, FoundColumns
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import LineStack
from dsl_core.reconstruction.rows.bands import some_rows
from dsl_core.reconstruction.rows.frames import ScanFrames

#: With more bands than these, the maps of the picture need the memory more than the frames of the last band.
FEW_BANDS = 8


def columns_by_rows(
    rig: Rig,
    options: Options,
    frames: ScanFrames,
    code: DecodedCode,
    white: MergedFrame,
    peak_error: float | None,
    progress: Progress | None = None,
) -> FoundColumns:
    """Refine and triangulate decoded columns band by band.

    ``peak_error`` is that of the modelled peak of lines, relative to it, None for the usual one.
    """
    height, width = code.column.shape
    search = ColumnSearch(rig, frames.plan, options.refine_columns, options.device, peak_error)
    found = FoundColumns.empty(height * width)
    for band in frames.bands:
        stack, here = frames.lines(band, progress), band.rows
        own = LineStack(stack.radiance[:, band.own], stack.std[:, band.own], stack.black_std[band.own])
        flat = slice(here.start * width, here.stop * width)
        found.put(flat, search.find(some_rows(code, here), some_rows(white, here), own, flat.start, progress))
    if len(frames.bands) > FEW_BANDS:
        frames.let_go()
    return found
