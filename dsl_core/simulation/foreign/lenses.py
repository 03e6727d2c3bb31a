"""What light passes: lenses that magnify colours differently, and a tilted bandpass filter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.sensor import bayer_channels
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.scenes.truth import Scene, SceneTruth

#: Distance of red and blue at the side of the picture, as a share of half its width: half a pixel of the
#: published camera (890 px wide) and projector (640 px), whatever the picture's size.
CAMERA_APART, PROJECTOR_APART = 0.5 / 445, 0.5 / 320
#: What red and blue are to the projector, nm: middles of its LEDs.
RED_NM, BLUE_NM = 630.0, 455.0


def camera_of_colour(lens: Lens, channel: int, foreign: Foreign) -> Lens:
    """The lens as one colour of the mosaic (0 red, 1 green, 2 blue) sees through it."""
    if not foreign.has("lateral-colour"):
        return lens
    ratio = 1 + (0.5, 0.0, -0.5)[channel] * CAMERA_APART
    return lens.model_copy(update={"fx_px": lens.fx_px * ratio, "fy_px": lens.fy_px * ratio})


def truth_of_colours(rig: Rig, scene: Scene, foreign: Foreign) -> SceneTruth:
    """Depth, material and shadow of every pixel as its own colour of the mosaic sees them.

    Beside a jump of depth, colours that lenses magnify differently see other surfaces. The rest is what
    green sees.
    """
    seen = [
        scene.render(camera_of_colour(rig.camera, colour, foreign), rig.pose.projector_centre_mm)
        for colour in range(3)
    ]
    mosaic = bayer_channels(rig.sensor.bayer, rig.camera.height_px, rig.camera.width_px)
    return replace(
        seen[1],
        depth_mm=np.choose(mosaic, [each.depth_mm for each in seen]),
        material=np.choose(mosaic, [each.material for each in seen]),
        lit=np.choose(mosaic, [each.lit for each in seen]),
    )


def projector_magnification(wavelengths_nm: NDArray[np.float64], foreign: Foreign) -> NDArray[np.float64]:
    """Magnification of light of each wavelength, relative to that half way from blue to red."""
    if not foreign.has("lateral-colour"):
        return np.ones_like(wavelengths_nm)
    place = (wavelengths_nm - 0.5 * (RED_NM + BLUE_NM)) / (RED_NM - BLUE_NM)
    return np.asarray(1 + place * PROJECTOR_APART)


#: Effective refractive index of the layers, and tilt of the filter about a vertical axis, degrees.
INDEX, TILT_DEG = 1.9, 3.0


def centre_ratio(lens: Lens, foreign: Foreign) -> NDArray[np.float64]:
    """Centre of the band at every pixel relative to that of light straight through, (rows * columns,).

    ``sqrt(1 - (sin angle / index)^2)`` (Macleod, Thin-Film Optical Filters).
    """
    rays = pixel_rays(lens).reshape(3, -1)
    if not foreign.has("filter-angle"):
        return np.ones(rays.shape[1])
    tilt = np.radians(TILT_DEG)
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    cosine = normal @ rays / np.linalg.norm(rays, axis=0)
    return np.asarray(np.sqrt(1 - (1 - cosine**2) / INDEX**2))
