"""Seconds to render the truth of every scene at full size, and to colour a full cube."""

from __future__ import annotations

import time

import numpy as np

from dsl_core.model.geometry import Lens
from dsl_core.optics.colour import reflectance_to_srgb
from dsl_core.simulation.scenes import make_scene, scene_catalogue

CAMERA = Lens(
    width_px=890,
    height_px=580,
    fx_px=1761.23,
    fy_px=1764.04,
    cx_px=428.86,
    cy_px=294.84,
    distortion=(-0.23400, 0.10229, -0.00193, -0.00087, 1.05616),
)
CENTRE_MM = np.array([56.08, 17.15, -21.61])


def main() -> None:
    """Print one line a scene, then one for the sRGB image of 47 bands."""
    make_scene("plane").render(CAMERA, CENTRE_MM)  # rays of the lens are computed once
    for entry in scene_catalogue():
        started = time.perf_counter()
        scene = make_scene(entry.name)
        made = time.perf_counter()
        scene.render(CAMERA, CENTRE_MM)
        print(f"{entry.name:14s} make {made - started:5.2f} s, render {time.perf_counter() - made:5.2f} s")
    bands = np.arange(430.0, 661.0, 5.0)
    cube = np.random.default_rng(0).random((bands.size, 580, 890), np.float32)
    reflectance_to_srgb(cube[:, :2], bands)
    started = time.perf_counter()
    reflectance_to_srgb(cube, bands)
    print(f"sRGB of {bands.size} x 580 x 890 float32: {time.perf_counter() - started:.3f} s")


if __name__ == "__main__":
    main()
