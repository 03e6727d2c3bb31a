"""Seconds to render the truth of every scene at full size, and to colour a full cube."""

from __future__ import annotations

import time

import numpy as np

from dsl_core.optics.colour import reflectance_to_srgb
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.scenes.catalogue import make_scene, scene_catalogue

CAMERA = published_rig().camera
CENTRE_MM = published_rig().pose.projector_centre_mm


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
