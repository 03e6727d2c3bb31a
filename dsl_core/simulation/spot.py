"""Light that reaches one spot of the scene: what a spectroradiometer looks at."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.optics.correspondence import GratingModel, zero_order
from dsl_core.simulation.world import World

Floats = NDArray[np.float64]
ORDERS = (1, -1)


def spot_light(world: World, spot: tuple[int, int], wavelengths_nm: Floats) -> Floats:
    """Spectral radiance of the light on a camera pixel (row, column), in units of the emission curves.

    The zero order comes from one projector pixel, first orders (with the film) from another column at each
    wavelength.
    """
    rig, depth_mm = world.rig, float(world.truth.depth_mm[spot])
    if not np.isfinite(depth_mm):
        return np.zeros(len(wavelengths_nm))
    pixel = torch.tensor([spot[0] * rig.camera.width_px + spot[1]])
    depth = torch.tensor([depth_mm], dtype=torch.float64)
    emission = np.stack([curve.at(wavelengths_nm) for curve in rig.emission])
    column, row = (float(q[0]) for q in zero_order(rig, pixel, depth))
    total = (_drive(world, np.array([column]), np.array([row])) * emission).sum(0)
    nm = wavelengths_nm.copy()  # torch wants to own what it reads
    for order in ORDERS if world.film else ():
        columns, rows = (q[:, 0].numpy() for q in GratingModel(rig).exact(pixel, depth, order, nm))
        share = rig.efficiency[order].at(wavelengths_nm)
        total = total + share * (_drive(world, columns, rows) * emission).sum(0)
    return np.asarray(total)


def _drive(world: World, columns: Floats, rows: Floats) -> Floats:
    """Radiance of each LED at projector pixels, shape (3, n); only the dark projector's outside its frame."""
    response = world.rig.projector_response
    height, width = world.rig.projector.height_px, world.rig.projector.width_px
    shown = np.zeros((height, width, 1), np.uint8) if world.image is None else np.atleast_3d(world.image)
    x, y = np.round(columns).astype(int), np.round(rows).astype(int)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    levels = shown[y.clip(0, height - 1), x.clip(0, width - 1)] / 255
    radiance = np.where(inside[:, None], response.radiance(levels), 0.0)
    return np.broadcast_to(radiance, (len(columns), 3)).T
