"""The banded solver on a processor: what the compiled kernels need, and Python's side of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.reconstruction.spectral.solving.prior import Prior, roughness
from dsl_core.reconstruction.spectral.solving.solution import LOCAL_STD, WITHIN_BAND, Spectra
from dsl_core.reconstruction.spectral.solving.solver import (
    ACTIVE_SET_ROUNDS,
    PENALTY,
    TOLERANCE,
    solve_tensors,
)
from dsl_core.solve import banded
from dsl_core.solve.lane_kernels import LANES, ROWS, SUMS, solve_blocks
from dsl_core.solve.many import Check, never
from dsl_core.solve.neighbour_sums import gather

Floats = NDArray[np.float64]
#: Fewest diagonals beside the main one that a kernel is compiled for; more are a power of two.
LEAST_DIAGONALS = 4


def solve_spectra(
    data: Tensor, right: Tensor, rows: Tensor | None, prior: Prior, check: Check = never
) -> Spectra:
    """Posterior of every pixel's spectrum, as `solve_tensors` explains it; compiled where there is no GPU."""
    if data.device.type != "cpu":
        return solve_tensors(data, right, rows, prior, check)
    check()
    bands, pixels = right.shape
    solver = LaneSolver(prior, bands, diagonals_for(len(data) - 1))
    equations = np.zeros((1, whole_blocks(pixels), solver.channels(offsets=False)))
    matrix = equations[0, :pixels, : bands * solver.size].reshape(pixels, bands, solver.size)
    for o in range(len(data)):
        matrix[:, : bands - o, o] = data[o, : bands - o].T.numpy()
    equations[0, :pixels, bands * solver.size : bands * (solver.size + 1)] = right.T.numpy()
    index = np.full((1, equations.shape[1]), -1, np.int64)
    index[0, :pixels] = np.arange(pixels)
    broad = None
    if rows is not None:
        strength = np.zeros((1, bands, ROWS, index.shape[1]))
        strength[0, :, : rows.shape[1], :pixels] = rows.numpy()
        broad = strength, np.zeros((1, ROWS, index.shape[1]))
    found = Found.empty(bands, pixels)
    solver.solve(equations, index, np.ones(index.shape), None, broad, found)
    return found.spectra(right.dtype)


def compile_early() -> None:
    """Solve one pixel: the kernel that serves most pictures, ten seconds of compiling, is there then."""
    data = torch.zeros((LEAST_DIAGONALS + 1, 2 * LEAST_DIAGONALS, 1), dtype=torch.float64)
    data[0] = 1.0
    solve_spectra(data, data[0], None, Prior())


def diagonals_for(bandwidth: int) -> int:
    """Diagonals of the kernel that serves a bandwidth: each needs compiling, so that there are few."""
    size = LEAST_DIAGONALS
    while size < bandwidth:
        size *= 2
    return size


def whole_blocks(pixels: int) -> int:
    """The number of pixels rounded up to whole blocks."""
    return -(-pixels // LANES) * LANES


@dataclass(frozen=True)
class Found:
    """Results in the order of pixels: (bands, pixels), smoothness and reduced chi-square (pixels,)."""

    nodes: Floats
    mean: Floats
    std: Floats
    data_share: Floats
    at_bound: NDArray[np.bool_]
    tau: Floats
    misfit: Floats

    @classmethod
    def empty(cls, bands: int, pixels: int) -> Found:
        """Arrays to be filled."""
        nodes, mean, std, share = (np.zeros((bands, pixels)) for _ in range(4))
        flags = np.zeros((bands, pixels), bool)
        return cls(nodes, mean, std, share, flags, np.zeros(pixels), np.zeros(pixels))

    def spectra(self, dtype: torch.dtype) -> Spectra:
        """The spectra as tensors."""
        nodes, mean, std, share, tau = (
            torch.from_numpy(each).to(dtype)
            for each in (self.nodes, self.mean, self.std, self.data_share, self.tau)
        )
        return Spectra(nodes, mean, std, share, tau, torch.from_numpy(self.at_bound))


class LaneSolver:
    """Solves grids of pixels with one prior; keeps its buffers, so that one solver serves one thread."""

    def __init__(self, prior: Prior, bands: int, diagonals: int, parameters: float = 0.0) -> None:
        """``parameters`` are the degrees of freedom that a spectrum takes from its data."""
        self.bands, self.size = bands, diagonals + 1
        # Always of one type: the loops would be compiled once more for a whole number.
        self._parameters = float(parameters)
        self._diagonals = (0,) * diagonals
        ridge = prior.level_std**-2
        shape = roughness(bands, torch.zeros(1, dtype=torch.float64))
        self._prior = np.vstack([shape.numpy(), np.full((1, bands), ridge)])
        self._taus, self._level = np.array(prior.taus), prior.level
        weights = [shape * tau**-2 for tau in prior.taus]
        for each in weights:
            each[0] += ridge
        pivots = [banded.factorise(each[..., None]).diagonal[:, 0] for each in weights]
        self._volumes = 1 / torch.stack(pivots).numpy()
        self._bounds = np.array([*prior.bounds, TOLERANCE, PENALTY, ACTIVE_SET_ROUNDS])
        self._work = self._workspace(diagonals)

    def _workspace(self, band: int) -> tuple[Any, ...]:
        bands, size, margin = self.bands, self.size, self.bands + 2 * band
        window = size * (size + 1 + ROWS) + SUMS + size
        rows = (self.channels(True), *(bands,) * 3, bands * ROWS, window, bands * (band + 2 + ROWS),
                band * (band + 1), 3 * bands, ROWS * margin)  # fmt: skip
        solutions = [np.zeros(margin * LANES) for _ in range(5)]
        solutions[-1][band * LANES : (band + bands) * LANES] = 1.0
        marks = (
            *(np.zeros(bands * LANES, bool) for _ in range(2)),
            *(np.zeros(LANES, bool) for _ in range(2)),
        )
        return (
            tuple(np.zeros(count * LANES) for count in rows),
            (*solutions, np.zeros(bands * LANES)),
            np.zeros((len(self._taus) + 1, LANES)),
            marks,
        )

    def channels(self, offsets: bool) -> int:
        """Numbers that the equations of a pixel consist of."""
        return self.bands * (self.size + 1) + 2 + (self.bands if offsets else 0)

    def solve(
        self,
        equations: Floats,
        index: NDArray[np.int64],
        shading: Floats,
        shares: Floats | None,
        broad: tuple[Floats, Floats] | None,
        found: Found,
    ) -> None:
        """Solve a grid (rows, columns) of whole blocks into ``found``, at the places that ``index`` says.

        With ``shares`` (rows, 8, columns) ``equations`` are those of samples with a margin of one, otherwise
        those of the pixels themselves. Raises `ValueError` where a system is not positive definite.
        """
        rows, levels = broad or (np.zeros((0, 0, 0, 0)), np.zeros((0, 0, 0)))
        gathered = np.empty((*index.shape, equations.shape[2]))
        own = np.zeros((0, 0, 0)) if shares is None else shares
        matrix = self.bands * self.size
        gather(equations, shares is not None, own, shading, matrix, self.bands, gathered)
        sound = solve_blocks(
            gathered, index, shading, equations.shape[2] == self.channels(True), rows, levels, self._prior,
            self._volumes, self._taus, self._bounds, self._level, WITHIN_BAND, LOCAL_STD**-2,
            self._parameters, self._diagonals, *self._work,
            found.nodes, found.mean, found.std, found.data_share, found.at_bound, found.tau,
            found.misfit,
        )  # fmt: skip
        if not sound:
            raise ValueError(banded.NOT_DEFINITE)
