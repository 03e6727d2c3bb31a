"""Spectra by compiled code against those by tensors in double precision, which a GPU runs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.geometry import reconstruct_geometry
from dsl_core.reconstruction.scan_result import known_pixels
from dsl_core.reconstruction.spectral import spectra
from dsl_core.reconstruction.spectral.solving import tensor_tiles
from dsl_core.reconstruction.spectral.solving.compiled_tiles import on_grid
from dsl_core.reconstruction.spectral.solving.solver import solve_tensors
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps
from tests.stability.bench import GRID, WINDOW_PX, Patch, Staged, staged


@cache
def stage() -> tuple[Staged, Pixels]:
    """A patch with a hole in it, merged, and what is known of its pixels."""
    made = staged(Patch())
    geometry = reconstruct_geometry(
        made.rig, made.plan, made.code, made.white, made.stack, surface_window_px=WINDOW_PX
    )
    pixels = known_pixels(geometry)
    pixels.valid[3:5, 4:7] = False
    return made, pixels


def solved(monkeypatch: pytest.MonkeyPatch, compiled: bool, **changes: Any) -> SpectralMaps:
    """Spectra of the patch with some of its arrays changed."""
    made, pixels = stage()
    arrays: dict[str, Any] = {
        "radiance": made.stack.radiance,
        "std": made.stack.std,
        "pixels": pixels,
        "rig": made.rig,
    } | changes
    monkeypatch.setattr(spectra, "TILE", (10, 14))
    solver = SpectralReconstruction(
        arrays["rig"], made.plan, GRID, correspondence(made.rig), arrays["radiance"], arrays["std"],
        arrays["pixels"], dtype=torch.float32 if compiled else torch.float64,
    )  # fmt: skip
    assert (solver._lines is not None) == compiled
    with monkeypatch.context() as patch:
        if not compiled:
            patch.setattr(tensor_tiles, "solve_spectra", solve_tensors)
        return solver.run(threads=1)


def assert_same(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> SpectralMaps:
    found, wanted = (solved(monkeypatch, compiled, **changes) for compiled in (True, False))
    known = np.isfinite(wanted.reflectance)
    assert known.any()
    np.testing.assert_array_equal(np.isfinite(found.reflectance), known)
    np.testing.assert_array_equal(found.reach, wanted.reach)
    off = np.abs(found.reflectance - wanted.reflectance)[known] / wanted.std[known]
    assert off.max() < 0.05
    assert np.mean(off) < 1e-3
    assert found.std[known] == pytest.approx(wanted.std[known], rel=0.02)
    assert found.data_share[known] == pytest.approx(wanted.data_share[known], rel=3e-3, abs=1e-6)
    assert found.chi_square == pytest.approx(wanted.chi_square, rel=0.01, abs=1e-3)
    assert (found.at_bound != wanted.at_bound).mean() < 0.01
    return found


@pytest.mark.slow
def test_compiled_spectra_are_those_of_tensors(monkeypatch: pytest.MonkeyPatch) -> None:
    found = assert_same(monkeypatch)
    assert np.isnan(found.reflectance[:, 3:5, 4:7]).all()


@pytest.mark.slow
def test_offsets_that_all_frames_share_count(monkeypatch: pytest.MonkeyPatch) -> None:
    _, pixels = stage()
    unsure = replace(pixels, offset_std=np.full_like(pixels.offset_std, 0.05))
    assert_same(monkeypatch, pixels=unsure)


@pytest.mark.slow
def test_what_is_no_number_weighs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    made, _ = stage()
    rng = np.random.default_rng(0)
    radiance, std = made.stack.radiance.copy(), made.stack.std.astype(np.float32)
    for values, bad in ((radiance, np.nan), (radiance, np.inf), (std, np.nan), (std, np.inf), (std, 1e30)):
        values[rng.random(values.shape) < 0.02] = bad
    assert_same(monkeypatch, radiance=radiance, std=std)


@pytest.mark.slow
def test_monochrome_pixels_have_no_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    made, _ = stage()
    sensor = made.rig.sensor.model_copy(update={"bayer": "MONO"})
    assert_same(monkeypatch, rig=made.rig.model_copy(update={"sensor": sensor}))


def test_places_without_a_pixel_hold_one() -> None:
    index: NDArray[np.int64] = np.array([[1, -1], [-1, 0]])
    assert on_grid(np.array([[5.0, 7.0]]), index).tolist() == [[[7.0, 1.0], [1.0, 5.0]]]
