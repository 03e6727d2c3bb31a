"""Targets with relief: steps, sphere, wax, open box, relief and face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.simulation.scenes import materials as spectra
from dsl_core.simulation.scenes.surfaces import (
    ENDLESS,
    Block,
    Rectangle,
    Sphere,
    height_field,
    tilted,
    uniform,
)
from dsl_core.simulation.scenes.truth import IMAGE_CENTRE_MM, SKIN, WAX, Finish, Materials, Scene, check_range

Floats = NDArray[np.float64]
_CX, _CY = IMAGE_CENTRE_MM


def _wall(depth_mm: float, material: int) -> Rectangle:
    return tilted((0.0, 0.0, depth_mm), 0.0, 0.0, ENDLESS, uniform(material))


def steps(depth_mm: float = 640.0, step_mm: float = 25.0, count: int = 5) -> Scene:
    """A staircase of white blocks, nearest on the left, each a known step deeper, before a wall."""
    check_range("depth_mm", depth_mm, 300, 2000, "mm")
    check_range("step_mm", step_mm, 0.1, 100, "mm")
    check_range("count", count, 1, 20)
    back = depth_mm + count * step_mm
    width = 300.0 / count
    left = _CX - 150.0
    blocks = [
        Block(
            np.array([left + i * width, _CY - 90.0, depth_mm + i * step_mm]),
            np.array([left + (i + 1) * width, _CY + 90.0, back]),
            0,
        )
        for i in range(count)
    ]
    palette = Materials.of({"plaster": spectra.flat(0.85), "wall": spectra.flat(0.3)}, ("wall",))
    return Scene("steps", f"{count} steps of {step_mm:g} mm", (*blocks, _wall(back, 1)), palette)


def sphere(
    radius_mm: float = 60.0, depth_mm: float = 720.0, gloss: float = 0.0, roughness: float = 0.25
) -> Scene:
    """A ball, matte or glossy, its centre at a depth, before a white wall that its shadow falls on.

    ``gloss`` is the reflectance of its varnish at normal incidence, 0.04 for glass.
    """
    check_range("depth_mm", depth_mm, 300, 2000, "mm")
    check_range("radius_mm", radius_mm, 1, 0.4 * depth_mm, "mm")
    check_range("gloss", gloss, 0, 1)
    check_range("roughness", roughness, 0.05, 1)
    ball = Sphere(np.array([_CX, _CY, depth_mm]), radius_mm, uniform(0))
    palette = Materials.of(
        {"yellow": spectra.pigment(0.08, 0.75, 520.0), "diffuser": spectra.flat(spectra.SPECTRALON)},
        finishes={"yellow": Finish(gloss=gloss, roughness=roughness)},
    )
    description = f"ball of radius {radius_mm:g} mm in front of a white wall"
    return Scene("sphere", description, (ball, _wall(depth_mm + radius_mm + 10.0, 1)), palette)


def wax(depth_mm: float = 700.0) -> Scene:
    """A block and a ball of wax before a dark wall: light leaves them next to where it entered."""
    check_range("depth_mm", depth_mm, 400, 2000, "mm")
    block = Block(
        np.array([_CX - 110.0, _CY - 70.0, depth_mm]), np.array([_CX, _CY + 70.0, depth_mm + 60]), 0
    )
    ball = Sphere(np.array([_CX + 65.0, _CY, depth_mm + 45.0]), 45.0, uniform(0))
    palette = Materials.of(
        {"wax": spectra.pigment(0.45, 0.75, 480.0, 40.0), "wall": spectra.flat(0.1)}, ("wall",), {"wax": WAX}
    )
    surfaces = (block, ball, _wall(depth_mm + 100.0, 1))
    return Scene("wax", f"block and ball of wax at {depth_mm:g} mm", surfaces, palette)


def box(depth_mm: float = 760.0, deep_mm: float = 110.0, reflectance: float = 0.85) -> Scene:
    """An open box seen from above: white floor at a depth, a red and a green side wall, bright inside."""
    check_range("depth_mm", depth_mm, 400, 2000, "mm")
    check_range("deep_mm", deep_mm, 1, 200, "mm")
    check_range("reflectance", reflectance, 0, 1)
    half_x, half_y, half_z = 105.0, 75.0, deep_mm / 2
    x, y, z = np.eye(3)
    middle = np.array([_CX, _CY, depth_mm - half_z])
    floor = Rectangle(middle + half_z * z, x, y, (half_x, half_y), uniform(0))
    sides = [
        Rectangle(middle + sign * half_x * x, z, y, (half_z, half_y), uniform(m))
        for sign, m in ((-1, 1), (1, 2))
    ]
    ends = [Rectangle(middle + sign * half_y * y, x, z, (half_x, half_z), uniform(0)) for sign in (-1, 1)]
    palette = Materials.of(
        {
            "white": spectra.flat(reflectance),
            "red": spectra.pigment(0.06, 0.75, 595.0, 10.0),
            "green": spectra.green(),
            "wall": spectra.flat(0.1),
        }
    )
    surfaces = (floor, *sides, *ends, _wall(depth_mm + 20.0, 3))
    return Scene("box", f"open box, {deep_mm:g} mm deep", surfaces, palette)


def _edge(distance: Floats, width: float) -> Floats:
    """1 inside (negative distance), 0 outside, over about four widths."""
    return np.asarray(0.5 * (1.0 - np.tanh(distance / width)))


def _gauss(x: Floats, y: Floats, x0: float, y0: float, sx: float, sy: float) -> Floats:
    return np.asarray(np.exp(-0.5 * (((x - x0) / sx) ** 2 + ((y - y0) / sy) ** 2)))


def _plateau(x: Floats, y: Floats) -> Floats:
    """Distance in mm to the rim of the raised ring of the relief; negative on it."""
    return np.asarray(np.abs(np.hypot(x + 70.0, y) - 42.0) - 14.0)


def relief(depth_mm: float = 740.0) -> Scene:
    """A carved relief with steep flanks behind a bar and a ball: occlusions and cast shadows."""
    check_range("depth_mm", depth_mm, 500, 2000, "mm")

    def height(x: Floats, y: Floats) -> Floats:
        hill = 45.0 * _gauss(x, y, 75.0, 15.0, 28.0, 34.0)
        waves = 3.0 * np.sin(x / 9.0) * np.sin(y / 11.0) * _edge(np.hypot(x, y) - 260.0, 20.0)
        return np.asarray(depth_mm - hill - 25.0 * _edge(_plateau(x, y), 3.0) - waves)

    def paint(x: Floats, y: Floats) -> NDArray[np.int32]:
        on_hill = np.hypot((x - 75.0) / 40.0, (y - 15.0) / 50.0) < 1.0
        return np.select([_plateau(x, y) < 0.0, on_hill], [1, 2], 0).astype(np.int32)

    carved = height_field(height, (300.0, 300.0), paint)
    bar = Block(np.array([-12.0, -400.0, depth_mm - 110.0]), np.array([2.0, 30.0, depth_mm - 100.0]), 3)
    ball = Sphere(np.array([110.0, -60.0, depth_mm - 80.0]), 22.0, uniform(4))
    palette = Materials.of(
        {
            "plaster": spectra.flat(0.8),
            "terracotta": spectra.pigment(0.12, 0.55, 590.0, 20.0),
            "blue glaze": spectra.ceramic_blue(),
            "grey bar": spectra.flat(0.35),
            "yellow ball": spectra.pigment(0.08, 0.75, 520.0),
        }
    )
    return Scene("relief", "relief with occlusions and cast shadows", (carved, bar, ball), palette)


def _face_height(x: Floats, y: Floats) -> Floats:
    """How far the face stands out of the wall, mm."""
    side = np.abs(x)
    inside = 1.0 - (x / 76.0) ** 2 - (y / 102.0) ** 2
    # A soft floor at zero, so that the head leaves the wall with a finite slope.
    head = 82.0 * (0.08 * np.logaddexp(0.0, inside / 0.08)) ** 0.6
    nose = 17.0 * _gauss(x, y, 0.0, 12.0, 10.5, 9.0) + 8.0 * _gauss(x, y, 0.0, -8.0, 8.0, 16.0)
    eyes = -7.0 * _gauss(side, y, 29.0, -18.0, 12.0, 8.0) + 4.0 * _gauss(side, y, 29.0, -17.0, 7.0, 4.5)
    brow = 3.5 * _gauss(side, y, 28.0, -34.0, 16.0, 5.0)
    lips = 5.0 * _gauss(x, y, 0.0, 48.0, 16.0, 6.5) - 2.5 * _gauss(x, y, 0.0, 48.0, 18.0, 1.5)
    chin = 8.0 * _gauss(x, y, 0.0, 76.0, 15.0, 10.0)
    cheeks = 4.0 * _gauss(side, y, 38.0, 18.0, 14.0, 14.0)
    return np.asarray(head + nose + eyes + brow + lips + chin + cheeks)


def _face_paint(x: Floats, y: Floats) -> NDArray[np.int32]:
    """Skin 0, lips 1, hair and brows 2, wall 3."""
    side = np.abs(x)
    lips = np.hypot(x / 23.0, (y - 48.0) / 8.0) < 1.0
    cheeks = np.hypot((side - 40.0) / 17.0, (y - 22.0) / 14.0) < 1.0
    brows = np.hypot((side - 29.0) / 16.0, (y + 34.0 + (side - 29.0) ** 2 / 90.0) / 3.5) < 1.0
    wall = np.hypot(x / 78.0, y / 104.0) > 1.0
    hair = y + 62.0 - x**2 / 130.0 < 0.0
    return np.select([wall, brows | hair, lips, cheeks], [3, 2, 1, 4], 0).astype(np.int32)


def face(depth_mm: float = 690.0) -> Scene:
    """A face-like smooth surface: skin with the double dip of haemoglobin, blushed cheeks, lips, hair."""
    check_range("depth_mm", depth_mm, 400, 2000, "mm")
    wall = depth_mm + 105.0

    def height(x: Floats, y: Floats) -> Floats:
        return wall - _face_height(x - _CX, y - _CY)

    surface = height_field(height, (130.0, 150.0), lambda x, y: _face_paint(x - _CX, y - _CY))
    palette = Materials.of(
        {
            "skin": spectra.skin(),
            "lips": spectra.skin(blood=0.015, melanin=0.01),
            "hair": spectra.hair(),
            "wall": spectra.flat(0.25),
            "cheek": spectra.skin(blood=0.008),
        },
        finishes=dict.fromkeys(("skin", "lips", "cheek"), SKIN),
    )
    return Scene("face", f"face-like surface at {depth_mm:g} mm", (surface,), palette)
