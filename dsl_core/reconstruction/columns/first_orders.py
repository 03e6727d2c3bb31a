"""How much light the first orders add to each frame of a pattern set, beside the zero order of white."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.image_formation import BlurredProfiles
from dsl_core.optics.sensor import bayer_channels
from dsl_core.reconstruction.depth import triangulate
from dsl_core.reconstruction.spectral.system import ORDERS, Bands, band_halfwidth_px

#: Bands beyond the frame by less still count, px.
EDGE_PX = 8.0
#: Bands that the light of a grey surface is summed over.
GRID = WavelengthGrid(step_nm=10.0)


def first_order_share(rig: Rig, profiles: NDArray[np.float64], pixels: Tensor, column_px: Tensor) -> Tensor:
    """First orders of a grey surface over its zero order under one LED, (pixels, LEDs, frames).

    ``pixels`` are flat indices of the mosaic, each seen in its own colour, lit directly from ``column_px``;
    ``profiles`` (frames, width, LEDs) are radiances relative to full drive, of one LED where all are alike.
    Zero where the column meets no ray.
    """
    bands = Bands.of(rig, GRID)
    depth, _ = triangulate(rig, pixels, column_px.double())
    met = torch.isfinite(depth)
    depth = torch.where(met, depth, sum(rig.depth_range_mm) / 2)
    y, x = pixels // rig.camera.width_px, pixels % rig.camera.width_px
    own = torch.as_tensor(bayer_channels(rig.sensor.bayer, 2, 2)).to(pixels.device)[y % 2, x % 2].long()
    leds, frames = profiles.shape[2], profiles.shape[0]
    found = torch.zeros((len(pixels), leds, frames)).to(column_px)
    for order in ORDERS:
        traced = correspondence(rig).trace(pixels, depth, order, bands.centroids_nm[order])
        columns = traced.columns.to(column_px)
        inside = traced.inside(rig.projector.width_px, rig.projector.height_px, margin_px=EDGE_PX)
        half = band_halfwidth_px(columns, bands.step_nm, bands.centres_nm)
        light = BlurredProfiles(rig.projector_response, profiles, half, column_px)
        share = torch.as_tensor(_shares(bands, order, leds)).to(column_px)[own]
        for j in range(bands.count):
            weight = share[..., j] * (inside[j] & met)[:, None]
            found += light.at(columns[j]) * weight[..., None]
    return found


def _shares(bands: Bands, order: int, leds: int) -> NDArray[np.float64]:
    """Response of an order over that of the whole zero order, (3 channels, LEDs, bands)."""
    first, zero = bands.moments[order], bands.moments[0].sum(2, keepdims=True)
    if leds == 1:
        first, zero = first.sum(1, keepdims=True), zero.sum(1, keepdims=True)
    return np.asarray(first / zero)
