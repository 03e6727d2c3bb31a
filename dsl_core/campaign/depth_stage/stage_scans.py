"""The scans of a plane on a stage as the depth-stage calibration takes them."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.common.tiles import ColumnSamples, tile_columns
from dsl_core.calibration.film.order_paths import LineFrames, thinned
from dsl_core.errors import CalibrationError
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import ScanLines
from dsl_core.model.result import DEPTH_INVALID
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress


def zero_order_columns(source: FrameSource, rig: Rig, progress: Progress | None = None) -> ColumnSamples:
    """Tile means of the columns of a scan with code and lines; raises what a reconstruction raises."""
    from dsl_core.reconstruction.geometry import reconstruct_geometry
    from dsl_core.reconstruction.merge import MergedScan, check_source, decode_columns, stack_lines
    from dsl_core.reconstruction.sanity import require_light, require_pixels

    plan = check_source(source, rig)
    # What the geometry leaves open is common to neighbouring pixels, and is about to be found.
    certain = rig.model_copy(update={"column_std_px": 0.0})
    merged = MergedScan(source, certain)
    code, white = decode_columns(merged, progress)
    require_light(white.radiance, white.saturated)
    stack = stack_lines(merged, progress)
    geometry = reconstruct_geometry(certain, plan, code, white, stack, progress=progress)
    require_pixels(geometry.flags)
    invalid = (geometry.flags & int(DEPTH_INVALID)) != 0
    return tile_columns(np.where(invalid, np.nan, geometry.column_px), geometry.column_std_px)


def lines_on_plane(source: FrameSource, rig: Rig) -> LineFrames:
    """The line frames of a scan at pixels evenly over the image; raises `CalibrationError` without lines."""
    from dsl_core.reconstruction.merge import MergedScan, check_source

    plan = check_source(source, rig)
    if not isinstance(plan.spectral, ScanLines):
        raise CalibrationError(f"The plan {plan.name!r} holds no scan lines. Capture the step again.")
    merged, pixels = MergedScan(source, rig), thinned(plan.camera_size_px)
    radiance = np.empty((plan.spectral_count, len(pixels)), np.float32)
    std = np.empty_like(radiance)
    for frame in range(plan.spectral_count):
        picture = merged.merge("spectral", frame)
        radiance[frame] = picture.radiance.ravel()[pixels]
        std[frame] = np.sqrt(picture.variance.ravel()[pixels])
    return LineFrames(plan.spectral, pixels, radiance, std)
