"""A scan of a flat diffuser as the chain correction takes it: what a reconstruction knows of each pixel."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.common.plane import fit_plane
from dsl_core.calibration.light.chain import LineScan
from dsl_core.errors import CalibrationError
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import Rig
from dsl_core.optics.flat_field import relative_gain
from dsl_core.optics.shading import plane_shading
from dsl_core.progress import Progress

#: Pixels that are used of each scan: with more, noise is no longer what limits the correction.
PIXELS = 6000
#: A flat target that fills the picture has at least this share of the lit pixels on one plane.
FLAT_SHARE = 0.8


def diffuser_lines(
    source: FrameSource, rig: Rig, progress: Progress | None = None, pixels: int = PIXELS
) -> LineScan:
    """Reconstruct a scan with code and lines of a flat target, and choose pixels evenly.

    Depth and shading are those of the plane through them. Raises `CalibrationError` when the scan holds
    no scan lines or the target is not flat, and what a reconstruction raises.
    """
    from dsl_core.reconstruction.geometry import reconstruct_geometry
    from dsl_core.reconstruction.merge import MergedScan, check_source, decode_columns, stack_lines
    from dsl_core.reconstruction.sanity import require_light, require_pixels
    from dsl_core.reconstruction.scan_result import known_pixels

    plan = check_source(source, rig)
    if not isinstance(plan.spectral, ScanLines):
        raise CalibrationError(
            f"The plan {plan.name!r} holds no scan lines, which the chain of the spectra is measured from."
            " Capture the diffuser with a plan of scan lines."
        )
    merged = MergedScan(source, rig)
    code, white = decode_columns(merged, progress)
    require_light(white.radiance, white.saturated)
    stack = stack_lines(merged, progress)
    geometry = reconstruct_geometry(rig, plan, code, white, stack, progress=progress)
    require_pixels(geometry.flags)
    known = known_pixels(geometry)
    # One plane for all pixels: its shading has none of the noise of normals of single pixels.
    flat = fit_plane(rig, geometry.depth_mm, known.valid)
    share = flat.on_plane.sum() / max(known.valid.sum(), 1)
    if share < FLAT_SHARE:
        raise CalibrationError(
            f"Only {share:.0%} of the lit pixels lie on one plane. Let the flat white target fill the"
            " picture, and capture the step again."
        )
    depth_mm, shading = flat.plane.depth_mm(rig), plane_shading(rig, flat.plane) * relative_gain(rig)
    valid = np.flatnonzero(flat.on_plane)
    # At random, since any regular step would meet the colours of the mosaic unevenly.
    chosen = np.sort(np.random.default_rng(0).permutation(valid)[:pixels])
    return LineScan(
        lines=plan.spectral,
        pixels=chosen.astype(np.int64),
        depth_mm=depth_mm.ravel()[chosen],
        shading=shading.ravel()[chosen],
        column_px=known.column_px.ravel()[chosen].astype(float),
        amplitude=known.amplitude.ravel()[chosen].astype(float),
        offset=known.offset.ravel()[chosen].astype(float),
        radiance=stack.radiance.reshape(len(stack.radiance), -1)[:, chosen],
        std=stack.std.reshape(len(stack.std), -1)[:, chosen].astype(np.float32),
    )
