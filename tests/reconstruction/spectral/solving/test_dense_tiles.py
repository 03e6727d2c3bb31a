"""Spectra of dense patterns by compiled code against those by tensors in double precision."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import torch

from dsl_core.errors import Cancelled
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.geometry import reconstruct_geometry
from dsl_core.reconstruction.scan_result import known_pixels
from dsl_core.reconstruction.spectral import spectra
from dsl_core.reconstruction.spectral.solving.compiled_tiles import STRIP
from dsl_core.reconstruction.spectral.solving.dense_solver import solve_dense
from dsl_core.reconstruction.spectral.solving.dense_tiles import DenseSolver, Solved
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps
from tests.stability.bench import GRID, WINDOW_PX, Patch, Staged, comb_plan, staged


@cache
def stage() -> tuple[Staged, Pixels]:
    """A patch under a comb with a hole in it, and what is known of its pixels."""
    made = staged(Patch(plan=comb_plan(64)))
    geometry = reconstruct_geometry(
        made.rig, made.plan, made.code, made.white, made.stack, surface_window_px=WINDOW_PX
    )
    pixels = known_pixels(geometry)
    pixels.valid[3:5, 4:7] = False
    return made, pixels


def solver_of(dtype: torch.dtype, **changes: Any) -> SpectralReconstruction:
    """The solver of the patch with some of its arrays changed."""
    made, pixels = stage()
    given: dict[str, Any] = {"rig": made.rig, "pixels": pixels} | changes
    return SpectralReconstruction(
        given["rig"], made.plan, GRID, correspondence(made.rig), made.stack.radiance, made.stack.std,
        given["pixels"], dtype=dtype,
    )  # fmt: skip


def assert_same(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> SpectralMaps:
    # Tiles of more than one strip that meet in the middle of the picture.
    monkeypatch.setattr(spectra, "TILE", (2 * (STRIP + 1), 14))
    solvers = [solver_of(dtype, **changes) for dtype in (torch.float32, torch.float64)]
    assert [solver._dense is None for solver in solvers] == [False, True]
    found, wanted = (solver.run(threads=1) for solver in solvers)
    known = np.isfinite(wanted.reflectance)
    assert known.any()
    np.testing.assert_array_equal(np.isfinite(found.reflectance), known)
    np.testing.assert_array_equal(found.reach, wanted.reach)
    off = np.abs(found.reflectance - wanted.reflectance)[known] / wanted.std[known]
    assert off.max() < 0.05
    assert np.mean(off) < 1e-3
    assert found.std[known] == pytest.approx(wanted.std[known], rel=0.02)
    assert found.data_share[known] == pytest.approx(wanted.data_share[known], rel=3e-3, abs=1e-3)
    assert found.chi_square == pytest.approx(wanted.chi_square, rel=0.01, abs=1e-3)
    assert (found.at_bound != wanted.at_bound).mean() < 0.01
    return found


def test_compiled_spectra_are_those_of_tensors(monkeypatch: pytest.MonkeyPatch) -> None:
    found = assert_same(monkeypatch)
    assert np.isnan(found.reflectance[:, 3:5, 4:7]).all()
    assert found.followed is not None
    assert found.followed.motion is None


def test_offsets_that_all_frames_share_count(monkeypatch: pytest.MonkeyPatch) -> None:
    _, pixels = stage()
    unsure = replace(pixels, offset_std=np.full_like(pixels.offset_std, 0.05))
    assert_same(monkeypatch, pixels=unsure)


def test_monochrome_pixels_have_no_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    made, _ = stage()
    sensor = made.rig.sensor.model_copy(update={"bayer": "MONO"})
    assert_same(monkeypatch, rig=made.rig.model_copy(update={"sensor": sensor}))


def test_a_tile_can_be_stopped_at_every_strip() -> None:
    solver = solver_of(torch.float32)
    rows = slice(0, 2 * STRIP + 1)
    frames = solver.frames(rows, slice(0, 6))
    asked = 0

    def check() -> None:
        nonlocal asked
        asked += 1
        if asked == 3:
            raise Cancelled("stop")

    assert solver._dense is not None
    with pytest.raises(Cancelled):
        solver._dense.solve(solver.model, frames, frames, solver.trace(frames), check)
    assert asked == 3


def test_what_rounding_made_negative_is_no_information() -> None:
    """Bright data leave combinations of bands open; the equations of the others leave rounding there."""
    rng = np.random.default_rng(2)
    bands, prior = 11, Prior()
    vectors = np.linalg.qr(rng.normal(size=(bands, bands)))[0]
    values = np.array([1e7] * 8 + [-300.0] * 3)
    data = np.stack([(vectors * values) @ vectors.T, 50.0 * np.eye(bands)])
    right = data @ np.full(bands, 0.5)
    own = [data[:, *np.triu_indices(bands)], right, np.full((2, 1), 1e9), np.full((2, 1), 60.0)]
    equations = np.concatenate(own, 1)[None]
    found = Solved.empty(2, bands)
    DenseSolver(prior, bands).solve(equations, np.array([[1, 0]]), found)
    assert found.sound.all()
    with torch.inference_mode():
        wanted = solve_dense(torch.from_numpy(data), torch.from_numpy(right), prior)
    spectra_found = found.spectra()
    for name in ("nodes", "std", "data_share"):
        exact = getattr(wanted, name).numpy()[:, ::-1]
        assert getattr(spectra_found, name).numpy() == pytest.approx(exact, rel=1e-4, abs=1e-5), name
    equations[0, 1, 3] = np.nan
    with pytest.raises(ValueError, match="positive definite"):
        DenseSolver(prior, bands).solve(equations, np.array([[1, 0]]), found)
