"""What scans of a flat target show at one position of the stage: columns of the zero order, lines, colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dsl_core.calibration.common.tiles import ColumnSamples, tile_columns
from dsl_core.calibration.film.order_paths import LineFrames, thinned
from dsl_core.campaign.common.flat_target import line_frames, scan_lines_of, scanned_geometry
from dsl_core.model.frames import FrameSource
from dsl_core.model.result import DEPTH_INVALID, Flag
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.progress import Progress

if TYPE_CHECKING:
    from dsl_core.reconstruction.columns.lateral_colour import ColumnBends


@dataclass(frozen=True)
class SeenPlane:
    """Tile means of the zero order's columns of a plane, the lines' look, and traces of lateral colour."""

    columns: ColumnSamples
    response: ProjectorResponse
    bends: ColumnBends | None


def seen_plane(source: FrameSource, rig: Rig, progress: Progress | None = None) -> SeenPlane:
    """The columns of a scan with code and lines; raises what a reconstruction raises."""
    from dsl_core.reconstruction.columns.lateral_colour import ColumnBends

    # What the geometry leaves open is common to neighbouring pixels, and is about to be found.
    shown, _, geometry = scanned_geometry(source, rig, progress, shared_errors=False)
    column_px = np.where((geometry.flags & int(DEPTH_INVALID)) != 0, np.nan, geometry.column_px)
    refined = np.where((geometry.flags & int(Flag.NOT_REFINED)) != 0, np.nan, column_px)
    return SeenPlane(
        tile_columns(column_px, geometry.column_std_px),
        shown.projector_response,
        ColumnBends.of(rig, refined.astype(np.float64)),
    )


def with_lateral_colour(rig: Rig, seen: Sequence[SeenPlane]) -> tuple[Rig, tuple[float, float] | None]:
    """The rig with the lateral colour that planes show, if any; how far red and blue are apart, px.

    First orders are seen in one colour each, so that their film would else be fitted to it.
    """
    from dsl_core.reconstruction.columns.lateral_colour import fit_lateral_colour

    bends = [each.bends for each in seen if each.bends is not None]
    if not bends:
        return rig, None
    found = fit_lateral_colour(rig, bends)
    colour = found.colour if found.present else None
    return rig.model_copy(update={"lateral_colour": colour}), (found.apart_px, found.apart_std_px)


def lines_on_plane(source: FrameSource, rig: Rig) -> LineFrames:
    """The line frames of a scan at pixels evenly over the image; raises `CalibrationError` without lines."""
    lines, pixels = scan_lines_of(source), thinned(source.plan.camera_size_px)
    return LineFrames(lines, pixels, *line_frames(source, rig, pixels))
