"""What pixels of a flat white target see of scan lines, lined up by their distance from the zero order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.light_path import zero_order_profile

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Half window (px) in which the light of the zero order is summed.
ZERO_HALF_PX = 9.0
#: Cells of the image, down and across, and pixels that one needs.
CELLS = (4, 6)
MIN_PIXELS = 12


@dataclass(frozen=True)
class PlanePixels:
    """Pixels of a flat white target.

    Arrays (P,): zero-order column (px), shading, colour 0..2; ``place`` (2, P), rows and columns of the image
    as shares 0..1. ``whole`` (P,) says, by order, where the order's light comes from rows inside the frame.
    """

    column_px: Floats
    shading: Floats
    colour: Ints
    place: Floats
    whole: dict[int, NDArray[np.bool_]]

    @property
    def cell(self) -> Ints:
        """Number of each pixel's cell of the image."""
        down, across = (
            np.clip((share * count).astype(int), 0, count - 1)
            for share, count in zip(self.place, CELLS, strict=True)
        )
        return np.asarray(down * CELLS[1] + across)

    def at(self, which: NDArray[np.bool_]) -> PlanePixels:
        """The pixels that are chosen."""
        whole = {order: inside[which] for order, inside in self.whole.items()}
        return PlanePixels(
            self.column_px[which], self.shading[which], self.colour[which], self.place[:, which], whole
        )


@dataclass(frozen=True)
class Graph:
    """What some pixels see of the lines, arrays (frames, P), and their zero-order amplitude (P,).

    Signal is without dark signal, zero order and halo; distance is that of the line from the zero order.
    """

    signal: Floats
    variance: Floats
    distance: Floats
    amplitude: Floats
    pixels: PlanePixels
    frame_px: int

    def holds(self, centre: Floats, half_px: float) -> NDArray[np.bool_]:
        """Pixels (P,) whose light at ``centre`` (P,) px from the zero order comes from inside the frame."""
        column = self.pixels.column_px + centre
        return np.asarray((column > half_px) & (column < self.frame_px - 1 - half_px))


def line_graph(
    lines: ScanLines,
    pixels: PlanePixels,
    radiance: Floats,
    std: Floats,
    distance: Floats,
    response: ProjectorResponse,
    unlit_px: tuple[float, float],
    frame_px: int,
) -> tuple[Graph, tuple[float, float]]:
    """Take dark signal, zero order and halo out; and how far the zero order moved, with deviation (px).

    The dark signal is that of lines between the distances ``unlit_px``; zero where there are none.
    """
    half, small = lines.width_px / 2, 0.01

    def profile(shift_px: float) -> Floats:
        return zero_order_profile(torch.as_tensor(shift_px - distance), -half, half, response).numpy()

    expected, slope = profile(0.0), (profile(small) - profile(-small)) / (2 * small)
    unlit = (np.abs(distance) > unlit_px[0]) & (np.abs(distance) < unlit_px[1])
    near = np.abs(distance) < ZERO_HALF_PX
    # Amplitude and dark signal of each pixel from its sums over lit and unlit lines, which hold whatever the
    # blur: lines that tile the frame share a pixel's light out among them.
    scale = near.sum(0) / np.maximum(unlit.sum(0), 1)
    lit, dark = (radiance * near).sum(0), (radiance * unlit).sum(0)
    lit_light, dark_light = (expected * near).sum(0), (expected * unlit).sum(0)
    amplitude = (lit - scale * dark) / (lit_light - scale * dark_light)
    offset = (dark - amplitude * dark_light) / np.maximum(unlit.sum(0), 1)
    signal = radiance - offset - amplitude * expected
    lever = np.where(near, amplitude * slope, 0.0)
    total = max(float((lever**2).sum()), 1e-30)
    moved = float((lever * signal).sum()) / total, float(np.sqrt(((lever * std) ** 2).sum())) / total
    return Graph(signal, std**2, distance, amplitude, pixels, frame_px), moved


def by_cell(pixels: PlanePixels, which: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """Masks of the chosen pixels of each cell, empty ones included."""
    cells = pixels.cell
    return [which & (cells == cell) for cell in range(CELLS[0] * CELLS[1])]
