"""The compiled solver against the one of tensors, which a GPU runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from numba import typeof

from dsl_core.reconstruction.spectral.solving import lane_solver
from dsl_core.reconstruction.spectral.solving.lane_solver import (
    Found,
    LaneSolver,
    compile_early,
    diagonals_for,
    solve_spectra,
    whole_blocks,
)
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.solver import solve_tensors
from dsl_core.solve import lane_kernels
from dsl_core.solve.lane_kernels import ROWS
from tests.stability.random_pixels import random_equations


@pytest.mark.parametrize("with_colour", [True, False])
def test_compiled_solver_and_tensors_give_the_same_spectra(with_colour: bool) -> None:
    # Not a whole number of blocks; many of these pixels are at a bound or see the zero order's colour.
    data, right, rows = random_equations(43, 5, torch.float64)
    some = rows if with_colour else None
    found, wanted = (solve(data, right, some, Prior()) for solve in (solve_spectra, solve_tensors))
    assert 0 < int(wanted.at_bound.sum()) == int((wanted.at_bound & found.at_bound).sum())
    for name in ("nodes", "mean"):
        assert ((getattr(found, name) - getattr(wanted, name)).abs() / wanted.std).max() < 1e-6
    for name in ("std", "data_share", "tau"):
        assert torch.allclose(getattr(found, name), getattr(wanted, name), rtol=1e-7, atol=1e-12)


def test_a_pixel_has_the_same_spectrum_whoever_is_beside_it() -> None:
    data, right, rows = random_equations(12, 6, torch.float64)
    together = solve_spectra(data, right, rows, Prior())
    alone = solve_spectra(data[..., 9:10], right[:, 9:10], rows[..., 9:10], Prior())
    assert torch.equal(alone.nodes[:, 0], together.nodes[:, 9])
    assert torch.equal(alone.std[:, 0], together.std[:, 9])


def test_what_is_compiled_early_serves_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    used = list[tuple[Any, ...]]()

    def solve_blocks(*arguments: Any) -> bool:
        used.append(tuple(map(typeof, arguments)))
        return bool(lane_kernels.solve_blocks(*arguments))

    monkeypatch.setattr(lane_solver, "solve_blocks", solve_blocks)
    compile_early()
    (early,) = used
    # As tiles of a picture are solved: with colours beside each pixel, broad rows and offsets.
    solver = LaneSolver(Prior(), 12, diagonals_for(3))
    index, shape = np.arange(16).reshape(1, 16), (3, 18, solver.channels(offsets=True))
    equations = np.zeros(shape)
    equations[..., : 12 * solver.size : solver.size] = 1.0
    broad = np.zeros((1, 12, ROWS, 16)), np.zeros((1, ROWS, 16))
    found = Found.empty(12, 16)
    solver.solve(equations, index, np.ones((1, 16)), np.full((1, 8, 16), 1 / 8), broad, found)
    assert used[1:]
    assert set(used) == {early}


def test_few_kernels_serve_all_bandwidths_and_blocks_are_whole() -> None:
    assert [diagonals_for(n) for n in (1, 4, 5, 8, 9)] == [4, 4, 8, 8, 16]
    assert [whole_blocks(n) for n in (0, 1, 8, 9)] == [0, 8, 8, 16]
