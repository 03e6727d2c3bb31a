"""Which rows a binary code names at pixels whose depth is known.

Light of the first orders comes from other rows of the projector than that of the zero order, the farther from
its axis the more. It cannot turn a bit, but it moves the place where a stripe seems to end by up to a quarter
of a pixel, to the same side for a whole part of the picture.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import BinaryCode
from dsl_core.model.rig import Rig
from dsl_core.optics.colour_neighbours import bayer_colours
from dsl_core.optics.correspondence import GratingModel, zero_order
from dsl_core.optics.spectra import ORDERS, chain_response
from dsl_core.optics.spread.curves import density
from dsl_core.patterns.binary_code import binary_image, decoder_of
from dsl_core.patterns.gray_code import frame_count

Floats = NDArray[np.float64]

#: Wavelengths whose light is added up, nm; places in a row of the projector, and how far a row is blurred.
LIGHT_NM = np.linspace(430.0, 670.0, 9)
PLACES, REACH_PX = 20, 6


def named_rows(
    rig: Rig, code: BinaryCode, pixels: NDArray[np.intp], depth_mm: Floats
) -> tuple[Floats, NDArray[np.int32]]:
    """Exact rows (px) of the zero order at flat pixels with depths (mm), and those the code names; all (n,).

    Named rows are -1 where the code is undecided. Surfaces are taken as white, and noise as none.
    """
    exact = zero_order(rig, torch.as_tensor(pixels), torch.as_tensor(depth_mm))[1].numpy()
    paths = [(_weights(rig, pixels, 0).sum(0), exact), *_first_orders(rig, pixels, depth_mm)]
    whole = np.sum([weight for weight, _ in paths], axis=0)
    size_px = (rig.projector.width_px, rig.projector.height_px)
    decoder = decoder_of(code, size_px)
    for frame in range(0, (2 if code.kind == "ensemble" else 1) * (frame_count(code, size_px) - 2), 2):
        image = binary_image(code, size_px, frame) > 0
        if (image[0] != image[0, 0]).any():
            light = np.full(len(pixels), float(image[0, 0]))  # a frame of columns, which do not matter here
            decoder.add(light, 1 - light)
            continue
        table = _blurred(rig, image[:, 0])
        light = np.sum([weight * table[_place(rows, len(table))] for weight, rows in paths], axis=0)
        decoder.add(light, whole - light)
    rows = decoder.finish().row
    assert rows is not None
    return exact, rows


def _first_orders(rig: Rig, pixels: NDArray[np.intp], depth_mm: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Weight and row (n,) of each wavelength of both orders."""
    for order in ORDERS:
        seen = GratingModel(rig).trace(torch.as_tensor(pixels), torch.as_tensor(depth_mm), order, LIGHT_NM)
        lit = seen.inside(rig.projector.width_px, rig.projector.height_px).numpy()
        yield from zip(_weights(rig, pixels, order) * lit, seen.rows.numpy(), strict=True)


def _weights(rig: Rig, pixels: NDArray[np.intp], order: int) -> Floats:
    """Light of an order at each wavelength (wavelengths, n), in one unit for all orders."""
    colour = bayer_colours(rig.sensor.bayer, *np.divmod(pixels, rig.camera.width_px))
    return np.asarray(chain_response(rig, order, LIGHT_NM).sum(1)[colour].T)


def _blurred(rig: Rig, rows: NDArray[np.bool_]) -> Floats:
    """Light of rows of the projector at places from one ``REACH_PX`` before the first on."""
    offsets = np.arange(-REACH_PX * PLACES, REACH_PX * PLACES + 1) / PLACES
    # Lines are spread across; of what happens along them only the width is known.
    kernel = density(rig.projector_response.blur_px, offsets)
    fine = np.repeat(rows.astype(np.float64), PLACES)
    return np.asarray(np.convolve(fine, kernel / kernel.sum()))


def _place(rows_px: Floats, count: int) -> NDArray[np.intp]:
    return np.asarray(((rows_px + 0.5 + REACH_PX) * PLACES).clip(0, count - 1), np.intp)
