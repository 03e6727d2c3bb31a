"""Flat targets: plane, stage, chart, filters and leaves."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.simulation import materials as spectra
from dsl_core.simulation.surfaces import Paint, tilted, uniform
from dsl_core.simulation.truth import Materials, Scene

#: The optical centre of the published camera lies beside the middle of its image; at 700 mm by this much.
_IMAGE_CENTRE_MM = (6.0, -2.0)
_ENDLESS = (math.inf, math.inf)
_STAGE_POSITIONS_MM = tuple(np.linspace(600.0, 900.0, 15).tolist())


def check_range(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raise `PlanError` unless ``low <= value <= high``."""
    if not low <= value <= high:
        wanted = f"{low:g} and {high:g} {unit}".rstrip()
        raise PlanError(f"Option {name} must lie between {wanted}, not {value:g}.")


def plane(
    depth_mm: float = 700.0, tilt_x_deg: float = 0.0, tilt_y_deg: float = 0.0, reflectance: float = 0.99
) -> Scene:
    """A flat white diffuser at a depth, optionally tilted about its horizontal (x) and vertical (y) axis."""
    check_range("depth_mm", depth_mm, 100, 5000, "mm")
    check_range("tilt_x_deg", tilt_x_deg, -75, 75, "degrees")
    check_range("tilt_y_deg", tilt_y_deg, -75, 75, "degrees")
    check_range("reflectance", reflectance, 0, 1)
    surface = tilted((0.0, 0.0, depth_mm), tilt_x_deg, tilt_y_deg, _ENDLESS, uniform(0))
    palette = Materials.of({"diffuser": spectra.flat(reflectance)})
    return Scene("plane", f"flat white diffuser at {depth_mm:g} mm", (surface,), palette)


def stage(index: int = 7, position_mm: float = math.nan) -> Scene:
    """A flat white diffuser at one of 15 stage positions, 600 to 900 mm (index 0 to 14), or anywhere."""
    if math.isnan(position_mm):
        check_range("index", index, 0, len(_STAGE_POSITIONS_MM) - 1)
        position_mm = _STAGE_POSITIONS_MM[index]
    flat = plane(position_mm)
    description = f"white diffuser on the stage at {position_mm:.1f} mm"
    return Scene("stage", description, flat.surfaces, flat.materials)


def patch_grid(columns: int, rows: int, pitch_mm: float, size_mm: float, frame: int) -> Paint:
    """Square patches in reading order (materials 0, 1, ...) with gaps of the material ``frame``."""

    def paint(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.int32]:
        x, y = u / pitch_mm + columns / 2, v / pitch_mm + rows / 2
        column, row = np.floor(x), np.floor(y)
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        inside &= np.maximum(np.abs(x - column - 0.5), np.abs(y - row - 0.5)) <= size_mm / pitch_mm / 2
        return np.where(inside, row * columns + column, frame).astype(np.int32)

    return paint


def color_checker(depth_mm: float = 700.0, tilt_x_deg: float = 0.0, tilt_y_deg: float = 0.0) -> Scene:
    """The 24 patches of the classic Color Checker (BabelColor average) in a dark frame before a wall."""
    check_range("depth_mm", depth_mm, 300, 2000, "mm")
    check_range("tilt_x_deg", tilt_x_deg, -45, 45, "degrees")
    check_range("tilt_y_deg", tilt_y_deg, -45, 45, "degrees")
    patches = spectra.chart_spectra()
    palette = Materials.of({**patches, "frame": spectra.flat(spectra.DARK), "wall": spectra.flat(0.2)})
    frame, wall = len(patches), len(patches) + 1
    painter = patch_grid(6, 4, 52.0, 44.0, frame)
    chart = tilted((*_IMAGE_CENTRE_MM, depth_mm), tilt_x_deg, tilt_y_deg, (161.0, 109.0), painter)
    behind = tilted((0.0, 0.0, depth_mm + 80.0), 0.0, 0.0, _ENDLESS, uniform(wall))
    return Scene("color-checker", f"Color Checker at {depth_mm:g} mm", (chart, behind), palette)
