"""Flat targets: plane, stage, chart, filters and leaves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.simulation.scenes import materials as spectra
from dsl_core.simulation.scenes.surfaces import ENDLESS, Paint, Sphere, tilted, turned, uniform
from dsl_core.simulation.scenes.truth import IMAGE_CENTRE_MM, Materials, Scene, check_range

_STAGE_POSITIONS_MM = tuple(np.linspace(600.0, 900.0, 15).tolist())


def plane(
    depth_mm: float = 700.0, tilt_x_deg: float = 0.0, tilt_y_deg: float = 0.0, reflectance: float = 0.99
) -> Scene:
    """A flat white diffuser at a depth, optionally tilted about its horizontal (x) and vertical (y) axis."""
    check_range("depth_mm", depth_mm, 100, 5000, "mm")
    check_range("tilt_x_deg", tilt_x_deg, -75, 75, "degrees")
    check_range("tilt_y_deg", tilt_y_deg, -75, 75, "degrees")
    check_range("reflectance", reflectance, 0, 1)
    surface = tilted((0.0, 0.0, depth_mm), tilt_x_deg, tilt_y_deg, ENDLESS, uniform(0))
    palette = Materials.of({"diffuser": spectra.flat(reflectance)})
    return Scene("plane", f"flat white diffuser at {depth_mm:g} mm", (surface,), palette)


def bowed(
    depth_mm: float = 700.0,
    bow_mm: float = 1.0,
    tilt_x_deg: float = 0.0,
    tilt_y_deg: float = 0.0,
    reflectance: float = 0.99,
) -> Scene:
    """A white diffuser that should be flat and bulges towards the camera, by ``bow_mm`` over 300 mm."""
    check_range("depth_mm", depth_mm, 100, 5000, "mm")
    check_range("bow_mm", bow_mm, 0.01, 50, "mm")
    check_range("tilt_x_deg", tilt_x_deg, -75, 75, "degrees")
    check_range("tilt_y_deg", tilt_y_deg, -75, 75, "degrees")
    radius = 150.0**2 / (2 * bow_mm) + bow_mm / 2
    middle = tilted((0.0, 0.0, depth_mm), tilt_x_deg, tilt_y_deg, ENDLESS, uniform(0))
    ball = Sphere(middle.centre_mm + radius * middle.normal, radius, uniform(0))
    palette = Materials.of({"diffuser": spectra.flat(reflectance)})
    return Scene("bowed", f"diffuser at {depth_mm:g} mm, bowed by {bow_mm:g} mm", (ball,), palette)


def stage(position_mm: float = 700.0, index: int = -1) -> Scene:
    """A flat white diffuser on the stage, anywhere or at one of 15 positions, 600 to 900 mm (index 0 to 14).

    With an ``index`` of -1, ``position_mm`` says where.
    """
    if index != -1:
        check_range("index", index, 0, len(_STAGE_POSITIONS_MM) - 1)
        position_mm = _STAGE_POSITIONS_MM[index]
    check_range("position_mm", position_mm, 100, 5000, "mm")
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


def color_checker(
    depth_mm: float = 700.0, tilt_x_deg: float = 0.0, tilt_y_deg: float = 0.0, roll_deg: float = 0.0
) -> Scene:
    """The 24 patches of the classic Color Checker (BabelColor average) in a dark frame before a wall."""
    check_range("depth_mm", depth_mm, 300, 2000, "mm")
    check_range("tilt_x_deg", tilt_x_deg, -45, 45, "degrees")
    check_range("tilt_y_deg", tilt_y_deg, -45, 45, "degrees")
    patches = spectra.chart_spectra()
    around = {"frame": spectra.flat(spectra.DARK), "wall": spectra.flat(0.2)}
    palette = Materials.of({**patches, **around}, tuple(around))
    frame, wall = len(patches), len(patches) + 1
    painter = patch_grid(6, 4, 52.0, 44.0, frame)
    check_range("roll_deg", roll_deg, -180, 180, "degrees")
    flat = tilted((*IMAGE_CENTRE_MM, depth_mm), tilt_x_deg, tilt_y_deg, (161.0, 109.0), painter)
    chart = turned(flat, roll_deg)
    behind = tilted((0.0, 0.0, depth_mm + 80.0), 0.0, 0.0, ENDLESS, uniform(wall))
    return Scene("color-checker", f"Color Checker at {depth_mm:g} mm", (chart, behind), palette)


#: Centres of the nine filters, nm, in reading order.
FILTER_CENTRES_NM = tuple(range(450, 651, 25))


def _discs(columns: int, rows: int, pitch_mm: float, radius_mm: float, background: int) -> Paint:
    """Discs in reading order (materials 0, 1, ...) on the material ``background``."""

    def paint(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.int32]:
        x, y = u / pitch_mm + columns / 2, v / pitch_mm + rows / 2
        column = np.clip(np.floor(x), 0, columns - 1)
        row = np.clip(np.floor(y), 0, rows - 1)
        inside = np.hypot(x - column - 0.5, y - row - 0.5) <= radius_mm / pitch_mm
        return np.where(inside, row * columns + column, background).astype(np.int32)

    return paint


def filters(depth_mm: float = 700.0, background: float = 0.03, fwhm_nm: float = 10.0) -> Scene:
    """Nine narrow band-pass filters as reflectors, 450 to 650 nm every 25 nm, on a dark or white board."""
    check_range("depth_mm", depth_mm, 300, 2000, "mm")
    check_range("background", background, 0, 1)
    check_range("fwhm_nm", fwhm_nm, 2, 100, "nm")
    names = {f"{nm} nm": spectra.bandpass(nm, fwhm_nm) for nm in FILTER_CENTRES_NM}
    palette = Materials.of({**names, "board": spectra.flat(background)}, ("board",))
    painter = _discs(3, 3, 68.0, 29.0, len(names))
    board = tilted((*IMAGE_CENTRE_MM, depth_mm), 0.0, 0.0, ENDLESS, painter)
    return Scene("filters", f"nine {fwhm_nm:g} nm filters at {depth_mm:g} mm", (board,), palette)


def _leaf_outlines(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.int32]:
    """A leaf left (0) and one right (1) of the middle on a board (2): two arcs that meet at the tips."""
    across = np.abs(np.abs(u) - 75.0)
    inside = across < 52.0 * (1.0 - (v / 95.0) ** 2)
    return np.where(inside, (u > 0).astype(np.int32), 2).astype(np.int32)


def leaves(depth_mm: float = 700.0) -> Scene:
    """A real leaf (left) and a dyed one (right): one colour under D65, two spectra (metamers)."""
    check_range("depth_mm", depth_mm, 300, 2000, "mm")
    palette = Materials.of(
        {"real leaf": spectra.leaf(), "dyed leaf": spectra.dyed_leaf(), "board": spectra.flat(0.5)},
        ("board",),
    )
    board = tilted((*IMAGE_CENTRE_MM, depth_mm), 0.0, 0.0, ENDLESS, _leaf_outlines)
    return Scene("leaves", f"real and dyed leaf at {depth_mm:g} mm", (board,), palette)
