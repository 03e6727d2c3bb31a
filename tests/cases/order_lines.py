"""Scan lines on a plane, seen through a bandpass filter by way of the first orders of a known film."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.film.order_paths import LineFrames, Passband, filter_passband, trace_paths
from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import Film, Rig
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.filters import nominal_filter
from dsl_core.optics.shading import Plane
from dsl_core.simulation.published_rig import published_rig

SIZE = (112, 72)
LINES = ScanLines(width_px=5, step_px=5)
TRUE_FILM = Film(distance_mm=28.6, lines_per_mm=497.0, tilt_x_deg=0.3, tilt_y_deg=-0.4, roll_deg=0.2)
NOISE = 0.01


def rig_with(film: Film) -> Rig:
    """A small camera, and this film."""
    rig = published_rig()
    return rig.model_copy(update={"camera": rig.camera.resized(*SIZE), "film": film})


def plane_at(depth_mm: float) -> Plane:
    """A target that hardly tilts."""
    return Plane(np.array([0.02, -0.03, 1.0]) / depth_mm)


def passband(rig: Rig, filter_nm: float, order: int) -> Passband:
    """That of a filter as its data sheet promises it."""
    dispersion = rig.projector.fx_px * rig.film.lines_per_mm * 1e-6
    return filter_passband(rig, nominal_filter(filter_nm), order, dispersion)


def line_frames(
    rig: Rig, plane: Plane, filter_nm: float, seed: int = 0, really_nm: float | None = None, skip: int = 1
) -> LineFrames:
    """What a camera sees of the first orders, with noise and a dark signal; no zero order.

    ``really_nm`` is where the filter in the beam passes, if it is another one; of ``skip`` pairs of rows one
    is seen.
    """
    rng = np.random.default_rng(seed)
    pixels = np.arange(SIZE[0] * SIZE[1])
    # Whole cells of the mosaic.
    pixels = pixels[pixels // SIZE[0] // 2 % skip == 0]
    centres = (LINES.width_px - 1) / 2 + LINES.step_px * np.arange(128)[:, None]
    light = np.full((128, len(pixels)), 0.02)
    half = LINES.width_px / 2
    for order in (1, -1):
        band = passband(rig, really_nm or filter_nm, order)
        paths = trace_paths(rig, plane, pixels, band, GratingModel(rig))
        sample = np.broadcast_to(np.arange(len(paths.at)), (128, len(paths.at)))
        off = centres - paths.column_px
        start, stop = (band.centroid_nm + paths.wavelength(sample, off + side * half) for side in (-1, 1))
        colour = np.broadcast_to(paths.colour, off.shape)
        share, _ = band.between(start, stop, colour)
        light[:, paths.at] += np.abs(share) * band.signal[paths.colour] * paths.shading
    std = np.full(light.shape, NOISE, np.float32)
    return LineFrames(
        LINES, pixels, (light + NOISE * rng.standard_normal(light.shape)).astype(np.float32), std
    )
