"""Geometry and rig follow what a scan says about its lenses: lateral colour, and the gain in the corners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dsl_core.model.fit import FitFinding
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.sensor import relative_gain
from dsl_core.reconstruction.columns.lateral_colour import (
    lateral_finding,
    material_std_px,
    own_lateral_colour,
)
from dsl_core.reconstruction.flat_field import flat_finding, own_flat_field, unsure_gain, with_flat_field
from dsl_core.reconstruction.geometry import Geometry


def follow_lenses(
    rig: Rig, lines: LineSet | None, geometry: Geometry, window_px: int | None = None
) -> tuple[Rig, Geometry, list[FitFinding]]:
    """Rig and geometry with what single lines show of the lenses where it matters, and what was found.

    ``window_px`` is that of `reconstruct_geometry`.
    """
    refined = (geometry.flags & int(Flag.NOT_REFINED)) == 0
    findings = []
    lateral = own_lateral_colour(rig, lines, geometry.column_px, refined)
    if lateral is not None:
        findings.append(lateral_finding(lateral))
        if lateral.present:
            rig = rig.model_copy(update={"lateral_colour": lateral.colour})
            geometry = geometry.by(rig, material_std_px(rig, geometry.column_px), window_px)
    if lines is None or not lines.single:
        return rig, geometry, findings
    surface = geometry.surface
    even = np.where(refined & ~surface.edge, surface.shading, np.nan)
    flat = own_flat_field(rig, geometry.amplitude, even)
    if flat is not None:
        findings.append(flat_finding(flat))
        if flat.present:
            rig, before = with_flat_field(rig, flat), rig
            shading = surface.shading * relative_gain(rig) / relative_gain(before)
            unsure = np.hypot(surface.shading_rel_std, unsure_gain(rig, flat))
            geometry = replace(geometry, surface=replace(surface, shading=shading, shading_rel_std=unsure))
    return rig, geometry, findings
