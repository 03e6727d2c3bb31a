"""Spectra of tiles of patterns that couple distant bands, without tensors where there is no GPU."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.optics.pixel_model import PixelModel, Traced
from dsl_core.reconstruction.spectral.solving.compiled_tiles import STRIP, grid_of, on_grid
from dsl_core.reconstruction.spectral.solving.dense_solver import semidefinite
from dsl_core.reconstruction.spectral.solving.dense_sums import add_dense
from dsl_core.reconstruction.spectral.solving.prior import Prior, roughness
from dsl_core.reconstruction.spectral.solving.solution import (
    PARAMETERS,
    Spectra,
    band_mean,
    share_of,
    within_band,
)
from dsl_core.reconstruction.spectral.solving.solver import ACTIVE_SET_ROUNDS, PENALTY, TOLERANCE
from dsl_core.reconstruction.spectral.solving.tensor_tiles import dense_samples
from dsl_core.reconstruction.spectral.solving.tile_frames import TileFrames
from dsl_core.solve import banded
from dsl_core.solve.dense_kernels import PANEL, channels, panelled, solve_full
from dsl_core.solve.lane_kernels import LEAST_VARIANCE, MOST_SHARE
from dsl_core.solve.many import Check
from dsl_core.solve.neighbour_sums import gather

Floats = NDArray[np.float64]


class DenseTiles:
    """Solves the tiles of a scan, each in the thread that asks for it."""

    def __init__(self, prior: Prior, direct_error: float) -> None:
        """``direct_error`` is that of the zero order, relative to it."""
        self._prior, self._direct_error = prior, direct_error
        self._local = threading.local()

    def solve(
        self, model: PixelModel, frames: TileFrames, near: TileFrames, traced: Traced, check: Check
    ) -> tuple[Spectra, Tensor]:
        """Spectra and reduced chi-square of a tile from the samples ``near`` it, whose light was traced."""
        margin = 0 if frames.bayer == "MONO" else 1
        height, width = (part.stop - part.start for part in (frames.rows, frames.columns))
        corner = frames.rows.start, frames.columns.start
        around = corner[0] - margin, corner[1] - margin
        samples = grid_of(near, around, (height + 2 * margin, width + 2 * margin))
        pixels = grid_of(frames, corner, (height, width))
        shading = on_grid(frames.known("shading").numpy(), pixels)
        shares = np.ascontiguousarray(frames.shares().swapaxes(0, 1)) if margin else np.zeros((0, 0, 0))
        light = self._light(model, near, traced)
        solver = self._solver(model.bands.count)
        found = Solved.empty(len(frames.flat), model.bands.count)
        equations = np.zeros((STRIP + 2 * margin, samples.shape[1], channels(model.bands.count)))
        done = 0
        for start in range(0, height, STRIP):
            check()
            stop = min(start + STRIP, height)
            own, part = (done, stop + 2 * margin), slice(start, stop)
            add_dense(*light[:4], samples, own, *light[4:], equations[done - start :])
            done = stop + 2 * margin
            gathered = solver.gathered(equations, bool(margin), shares[part], shading[part])
            solver.solve(gathered, pixels[part], found)
            # The last rows are needed again by the next strip.
            equations[: 2 * margin] = equations[stop - start : stop - start + 2 * margin]
        return found.spectra(), torch.from_numpy(found.misfit).float()

    def _light(self, model: PixelModel, near: TileFrames, traced: Traced) -> tuple[NDArray[Any], ...]:
        """What `add_dense` needs of samples and their light: four arrays, then those behind the grid."""
        colour, radiance, weight, variance = dense_samples(model, near, traced, self._direct_error)
        tables, moments = [model.zero_light(radiance).table], [model.bands.moments[0]]
        columns, inside = [], []
        for order, footprint in traced.orders.items():
            half = model.bands.half_width_px(footprint.columns)
            tables.append(model.light(half, radiance).table)
            moments.append(model.bands.moments[order])
            columns.append(footprint.columns.numpy())
            inside.append(model.inside(footprint).numpy())
        response = np.stack(moments).swapaxes(1, 2)
        if tables[0].shape[1] == 1:
            # Grey patterns light all LEDs alike: one stands for their sum.
            response = response.sum(1, keepdims=True)
        return (
            *(radiance.T.contiguous().numpy(), weight.T.contiguous().numpy(), colour.numpy()),
            variance.numpy(),
            *(traced.column_px.numpy(), traced.direct.numpy(), np.stack(columns), np.stack(inside)),
            *(torch.stack(tables).numpy(), np.ascontiguousarray(response.swapaxes(1, 2))),
        )

    def _solver(self, bands: int) -> DenseSolver:
        kept: dict[int, DenseSolver] = self._local.__dict__.setdefault("solvers", {})
        if bands not in kept:
            kept[bands] = DenseSolver(self._prior, bands)
        return kept[bands]


@dataclass(frozen=True)
class Solved:
    """What the compiled loop finds: (pixels, bands), smoothness, chi-square and soundness (pixels,)."""

    nodes: Floats
    variance: Floats
    local: Floats
    at_bound: NDArray[np.bool_]
    tau: Floats
    misfit: Floats
    sound: NDArray[np.bool_]

    @classmethod
    def empty(cls, pixels: int, bands: int) -> Solved:
        """Arrays to be filled."""
        nodes, variance, local = (np.zeros((pixels, bands)) for _ in range(3))
        held, sound = np.zeros((pixels, bands), bool), np.zeros(pixels, bool)
        return cls(nodes, variance, local, held, np.zeros(pixels), np.zeros(pixels), sound)

    def spectra(self) -> Spectra:
        """The spectra as tensors in single precision."""
        nodes, variance, local = (
            torch.from_numpy(each.T) for each in (self.nodes, self.variance, self.local)
        )
        std = torch.hypot(variance.clip(min=LEAST_VARIANCE).sqrt(), within_band(nodes))
        tau, held = torch.from_numpy(self.tau), torch.from_numpy(self.at_bound.T)
        return Spectra(nodes, band_mean(nodes), std, share_of(local), tau, held).to(torch.float32)


class DenseSolver:
    """Solves pixels with one prior; keeps its buffers, so that one solver serves one thread."""

    def __init__(self, prior: Prior, bands: int) -> None:
        self._level, self._bands = prior.level, bands
        wide, ridge = panelled(bands), prior.level_std**-2
        shape = roughness(bands, torch.zeros(1, dtype=torch.float64))
        self._prior = np.vstack([shape.numpy(), np.full((1, bands), ridge)])
        self._taus = np.array(prior.taus)
        self._volumes = np.ones((len(prior.taus), wide))
        for volume, tau in zip(self._volumes, prior.taus, strict=True):
            weights = shape * tau**-2
            weights[0] += ridge
            volume[:bands] = 1 / banded.factorise(weights[..., None]).diagonal[:, 0].numpy()
        self._bounds = np.array([*prior.bounds, TOLERANCE, PENALTY, ACTIVE_SET_ROUNDS])
        sizes = wide * (wide + PANEL), wide, wide * wide, *(bands,) * 3, wide, len(prior.taus)
        self._work = tuple(np.zeros(size) for size in sizes)

    def gathered(self, equations: Floats, neighbours: bool, shares: Floats, shading: Floats) -> Floats:
        """Equations of pixels (rows, columns, channels) from those of their samples, with ``shading``."""
        bands = self._bands
        gathered = np.empty((*shading.shape, channels(bands)))
        gather(equations, neighbours, shares, shading, bands * (bands + 1) // 2, bands, gathered)
        return gathered

    def solve(self, equations: Floats, index: NDArray[np.int64], found: Solved) -> None:
        """Solve pixels (rows, columns) into ``found``, at the places that ``index`` says, where it is one.

        Raises `ValueError` where a system is not positive definite, even without what rounding may have done.
        """
        wanted = index >= 0
        at, own = index[wanted], equations[wanted]
        some = self._solved(own)
        broken = ~some.sound
        if broken.any():
            is_finite = np.isfinite(own[broken]).all()
            again = self._solved(self._semidefinite(own[broken])) if is_finite else None
            if again is None or not again.sound.all():
                raise ValueError(banded.NOT_DEFINITE)
            for name, values in vars(some).items():
                values[broken] = getattr(again, name)
        for name, values in vars(some).items():
            getattr(found, name)[at] = values

    def _solved(self, equations: Floats) -> Solved:
        found = Solved.empty(len(equations), self._bands)
        solve_full(
            equations, self._prior, self._volumes, self._taus, self._level, self._bounds, float(PARAMETERS),
            MOST_SHARE, self._work, found.nodes, found.variance, found.local, found.at_bound, found.tau,
            found.misfit, found.sound,
        )  # fmt: skip
        return found

    def _semidefinite(self, equations: Floats) -> Floats:
        """Equations without what rounding left below zero, see `dense_solver.semidefinite`."""
        triangle = np.triu_indices(self._bands)
        full = np.zeros((len(equations), self._bands, self._bands))
        full[:, *triangle] = equations[:, : len(triangle[0])]
        full = semidefinite(torch.from_numpy(full + np.triu(full, 1).swapaxes(1, 2))).numpy()
        return np.concatenate([full[:, *triangle], equations[:, len(triangle[0]) :]], 1)
