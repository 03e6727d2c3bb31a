"""Spectra of tiles of single lines without tensors: samples' equations and their solution, strip by strip."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.optics.colour_neighbours import bayer_colours
from dsl_core.optics.lines import sums as line_sums
from dsl_core.optics.lines.equations import LEAST_SURPLUS, OrderLines
from dsl_core.optics.lines.profile import SAMPLES, halo_of_line
from dsl_core.optics.pixel_model import MODEL_ERROR, PixelModel, Traced
from dsl_core.reconstruction.spectral.solving.lane_solver import (
    Found,
    LaneSolver,
    diagonals_for,
    whole_blocks,
)
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.solution import PARAMETERS, Spectra
from dsl_core.reconstruction.spectral.solving.tile_frames import TileFrames
from dsl_core.solve.compiled import compiled
from dsl_core.solve.halves import squares_of_halves
from dsl_core.solve.many import Check

add_samples = compiled(line_sums.add_samples)
#: Rows of a tile whose equations are in memory at once, so that they stay in the processor's cache.
STRIP = 4


class CompiledTiles:
    """Solves the tiles of a scan, each in the thread that asks for it."""

    def __init__(self, prior: Prior) -> None:
        self._prior = prior
        self._local = threading.local()

    def solve(
        self,
        model: PixelModel,
        stacks: tuple[NDArray[np.float32], NDArray[np.floating], int],
        frames: TileFrames,
        near: TileFrames,
        traced: Traced,
        colour: tuple[Tensor, Tensor] | None,
        check: Check,
    ) -> tuple[Spectra, Tensor]:
        """Spectra and reduced chi-square of a tile from the samples ``near`` it, whose light was traced.

        ``stacks`` are radiance and deviation (frames, rows, columns) and the row of the picture they begin
        with, ``colour`` zero-order colour and roots of its weights, (3, pixels), where they are needed.
        """
        bayer = frames.bayer
        margin = 0 if bayer == "MONO" else 1
        height, width = (part.stop - part.start for part in (frames.rows, frames.columns))
        corner = frames.rows.start - margin, frames.columns.start - margin
        radiance, std, first_row = stacks
        half = std.dtype == np.float16
        halves = std.view(np.uint16) if half else np.zeros((0, 0, 0), np.uint16)
        singles = np.zeros((0, 0, 0), np.float32) if half else np.asarray(std, np.float32)
        origin = corner[0] - first_row, corner[1]
        wide = whole_blocks(width)
        samples = grid_of(near, corner, (height + 2 * margin, wide + 2 * margin))
        pixels = grid_of(frames, (frames.rows.start, frames.columns.start), (height, wide))
        light, surplus, diagonals = _light(model, near, traced)
        offsets = bool((near.known("offset_std") > 0).any())
        solver = self._solver(model.bands.count, diagonals)
        shading = on_grid(frames.known("shading").numpy(), pixels)
        shares = None if margin == 0 else np.ascontiguousarray(frames.shares(wide).swapaxes(0, 1))
        found = Found.empty(model.bands.count, len(frames.flat))
        equations = np.zeros((STRIP + 2 * margin, samples.shape[1], solver.channels(offsets)))
        done = 0
        for start in range(0, height, STRIP):
            check()
            stop = min(start + STRIP, height)
            add_samples(
                radiance, halves, singles, squares_of_halves(), origin, samples,
                (done, stop + 2 * margin), *light, surplus, solver.size, offsets,
                equations[done - start :],
            )  # fmt: skip
            done = stop + 2 * margin
            part = slice(start, stop)
            broad = None if colour is None else _broad(model, colour, shading[part], pixels[part])
            own = None if shares is None else shares[part]
            solver.solve(equations, pixels[part], shading[part], own, broad, found)
            if margin and stop < height:
                # The last rows are needed again by the next strip; numpy sees to it if they overlap.
                equations[: 2 * margin] = equations[stop - start : stop - start + 2 * margin]
        return found.spectra(torch.float32), torch.from_numpy(found.misfit).float()

    def _solver(self, bands: int, diagonals: int) -> LaneSolver:
        kept: dict[tuple[int, int], LaneSolver] = self._local.__dict__.setdefault("solvers", {})
        if (bands, diagonals) not in kept:
            kept[bands, diagonals] = LaneSolver(self._prior, bands, diagonals, PARAMETERS)
        return kept[bands, diagonals]


def grid_of(frames: TileFrames, corner: tuple[int, int], shape: tuple[int, int]) -> NDArray[np.int64]:
    """Places of a tile's pixels in its lists, on a grid of a shape; negative where there is none."""
    rows, columns = frames.place()
    index = np.full(shape, -1, np.int64)
    index[rows - corner[0], columns - corner[1]] = np.arange(len(rows))
    return index


def on_grid(values: NDArray[np.floating], index: NDArray[np.int64]) -> NDArray[np.float64]:
    """Values (..., pixels) on a grid (..., rows, columns), one where there is no pixel."""
    return np.where(index >= 0, values[..., index.clip(0)], 1.0).astype(np.float64, order="C")


def _broad(
    model: PixelModel,
    colour: tuple[Tensor, Tensor],
    shading: NDArray[np.float64],
    index: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Equations of the zero-order colour (rows, bands, 3, columns) and their values (rows, 3, columns)."""
    values, root = (on_grid(each.numpy(), index).transpose(1, 0, 2) for each in colour)
    root = root * (index >= 0)[:, None]
    moments = model.bands.moments[0].sum(1).T
    strength = moments[None, :, :, None] * (root * shading[:, None])[:, None]
    return np.ascontiguousarray(strength), np.ascontiguousarray(values * root)


def _light(model: PixelModel, near: TileFrames, traced: Traced) -> tuple[tuple[Any, ...], float, int]:
    """What `add_samples` needs of samples and their light, the surplus and the diagonals of the matrix."""
    lines, bands, response = model.lines, model.bands, model.rig.projector_response
    assert lines is not None
    tables, supports, lit, white, columns, inside = [], [], [], [], [], []
    surplus, bandwidth = LEAST_SURPLUS, 1
    for order, footprint in traced.orders.items():
        reached = model.inside(footprint)
        frames = model.frames(footprint.columns, reached)
        if not frames:
            continue
        width = model.width(footprint, reached)
        own = OrderLines.of(bands, lines, response.line_spread, footprint.columns, reached, width)
        surplus, bandwidth = max(surplus, own.dropped), max(bandwidth, own.bandwidth)
        tables.append(line_sums.by_line(own.table.values.numpy(), lines.step_px * SAMPLES))
        supports.append(round(own.table.support_px * SAMPLES))
        lit.append((frames.start, frames.stop))
        white.append(bands.moments[order].sum(1))
        columns.append((own.columns * SAMPLES).round().to(torch.int32).numpy())
        inside.append(reached.numpy())
    seen = max((table.shape[1] for table in tables), default=0)
    entries = np.zeros((len(tables), lines.step_px * SAMPLES, seen))
    for entry, table in zip(entries, tables, strict=True):
        entry[:, seen - table.shape[1] :] = table
    shape = (0, bands.count, len(near.flat))
    place = lines.position(near.known("column_px").double())
    before = place.floor()
    distances = torch.stack([place - before, before + 1 - place]) * lines.step_px
    falls = halo_of_line(torch.arange(lines.lines + 1).double() * lines.step_px, lines.width_px, response)
    known = (near.known(name).numpy() for name in ("offset", "offset_std", "amplitude"))
    offset, offset_std, amplitude = known
    light = (
        np.stack(columns) if columns else np.zeros(shape, np.int32),
        np.stack(inside) if inside else np.zeros(shape, bool),
        entries,
        np.array(supports, np.int64),
        np.array(lit, np.int64).reshape(-1, 2),
        round(lines.first_px * SAMPLES),
        lines.step_px * SAMPLES,
        np.stack(white) if white else np.zeros((0, 3, bands.count)),
        bayer_colours(near.bayer, *near.place()),
        offset,
        offset_std**2,
        amplitude,
        before.long().numpy(),
        halo_of_line(distances, lines.width_px, response).numpy(),
        (falls / falls[0]).nan_to_num(0.0).numpy(),
        MODEL_ERROR,
    )
    return light, surplus, diagonals_for(bandwidth)
