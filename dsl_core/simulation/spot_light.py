"""Light on one place of the scene, spectrally, for the twin's spectroradiometer."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.optics.correspondence import GratingModel, zero_order
from dsl_core.simulation.foreign.exposure import light_level
from dsl_core.simulation.foreign.rig_changes import led_radiance
from dsl_core.simulation.world import World

Floats = NDArray[np.float64]


def spot_light(world: World, spot: tuple[int, int], wavelengths_nm: Floats) -> Floats:
    """Spectral radiance of the light on a camera pixel (row, column), in units of the emission curves.

    The zero order comes from one projector pixel, first orders (with the film) from another column at each
    wavelength.
    """
    rig, depth_mm = world.setup.true_rig, float(world.truth.depth_mm[spot])
    if not np.isfinite(depth_mm):
        return np.zeros(len(wavelengths_nm))
    pixel = torch.tensor([spot[0] * rig.camera.width_px + spot[1]])
    depth = torch.tensor([depth_mm], dtype=torch.float64)
    emission = np.stack([curve.at(wavelengths_nm) for curve in rig.emission])
    column, row = (float(q[0]) for q in zero_order(rig, pixel, depth))
    total = (_drive(world, np.array([column]), np.array([row])) * emission).sum(0)
    nm = wavelengths_nm.copy()  # torch needs a writable copy
    for order in (1, -1) if world.setup.film else ():
        columns, rows = (q[:, 0].numpy() for q in GratingModel(rig).exact(pixel, depth, order, nm))
        share = rig.efficiency[order].at(wavelengths_nm)
        total = total + share * (_drive(world, columns, rows) * emission).sum(0)
    return np.asarray(total)


def _drive(world: World, columns: Floats, rows: Floats) -> Floats:
    """Radiance of each LED at projector pixels, shape (3, n); only the dark projector's outside its frame."""
    foreign, response = world.setup.foreign, world.rig.projector_response
    height, width = world.rig.projector.height_px, world.rig.projector.width_px
    shown = np.zeros((height, width, 1), np.uint8) if world.image is None else np.atleast_3d(world.image)
    x, y = np.round(columns).astype(int), np.round(rows).astype(int)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    levels = shown[y.clip(0, height - 1), x.clip(0, width - 1)] / 255
    radiance = np.where(inside, led_radiance(response, levels.T, foreign), 0.0)
    return radiance if foreign is None else radiance * light_level(foreign, world.clock.now_s)
