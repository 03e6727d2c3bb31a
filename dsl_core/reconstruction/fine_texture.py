"""Depth whose deviations hold what neighbouring pixels scatter by, as over textures finer than pixels."""

from __future__ import annotations

import numpy as np

from dsl_core.model.fit import FitFinding
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.reconstruction.columns.scatter import scatter_of
from dsl_core.reconstruction.geometry import Geometry

#: Share of the pixels with a depth above which it is told.
MOST_SCATTERED = 0.05
#: Pixels of no smooth surface, or that lines say nothing of.
_DOUBTFUL = Flag.NOT_REFINED | Flag.UNUSUAL_PEAK | Flag.DEPTH_EDGE


def follow_scatter(
    rig: Rig, geometry: Geometry, window_px: int | None = None
) -> tuple[Geometry, list[FitFinding]]:
    """Geometry whose deviations hold what columns scatter by, and what is told of it.

    ``window_px`` is that of `reconstruct_geometry`.
    """
    known = np.isfinite(geometry.depth_mm)
    usable = known & ((geometry.flags & int(_DOUBTFUL)) == 0)
    found = scatter_of(geometry.column_px, geometry.column_std_px, usable)
    if found is None:
        return geometry, []
    more = known & (found.ratio > 1)
    share = float(more.sum() / max(known.sum(), 1))
    usual = float(np.median(found.ratio[more])) if more.any() else 1.0
    finding = FitFinding.judged(
        "surfaces",
        "columns that scatter by more than stated",
        share,
        "share",
        MOST_SCATTERED,
        f"In {share:.0%} of the pixels, columns of neighbours scatter {usual:.1f} times as much as their"
        " noise explains, as over textures that are finer than pixels. Deviations of depth contain it.",
        "Depth is better where more pixels see the texture: move the camera nearer, or use all its pixels.",
    )
    return geometry.by(rig, found.error_px, window_px), [finding]
