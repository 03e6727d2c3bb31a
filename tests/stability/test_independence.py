"""Results do not hang on tiles, threads or device, and an image's size changes none of its pixels."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import torch
import xarray as xr

import dsl_core.reconstruction.spectral.spectra as spectra
from dsl_core import pipeline
from dsl_core.errors import DecodeError
from dsl_core.model.plan import CapturePlan, GrayCode
from dsl_core.simulation.published_rig import published_rig
from tests.cases.crop import cropped_rig
from tests.cases.twin_scan import MemoryScan
from tests.stability.bench import MIDDLE, Patch, Staged, staged

#: Between tiles of other sizes, in stated deviations: lines' profiles are shared by the pixels of a tile.
BETWEEN_TILES = 0.3
#: Between devices, in stated deviations.
BETWEEN_DEVICES = 0.1


@cache
def _stage() -> Staged:
    return staged(Patch())


@cache
def _usual(dtype: torch.dtype) -> xr.Dataset:
    return _stage().finish(dtype)


def _off(one: xr.Dataset, other: xr.Dataset) -> float:
    """The largest difference of two results' spectra, in stated deviations."""
    difference = np.abs(one["reflectance"].values - other["reflectance"].values)
    return float((difference / one["reflectance_std"].values).max())


@pytest.mark.slow
def test_threads_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spectra, "TILE", (4, 6))
    one, four = (_stage().finish(torch.float32, threads=count) for count in (1, 4))
    for name in one:
        np.testing.assert_array_equal(one[name].values, four[name].values)


@pytest.mark.slow
@pytest.mark.parametrize("tile", [(2, 2), (4, 6), (6, 20)])
def test_tiles_of_any_size_agree(monkeypatch: pytest.MonkeyPatch, tile: tuple[int, int]) -> None:
    whole = _usual(torch.float64)
    monkeypatch.setattr(spectra, "TILE", tile)
    assert _off(whole, _stage().finish(torch.float64)) < BETWEEN_TILES


def test_single_precision_agrees_with_double() -> None:
    assert _off(_usual(torch.float64), _usual(torch.float32)) < 0.5


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_devices_agree(dtype: torch.dtype) -> None:
    assert _off(_usual(dtype), _stage().finish(dtype, device="cuda")) < BETWEEN_DEVICES


def test_one_pixel_is_refused_with_its_reason() -> None:
    rig = cropped_rig(MIDDLE, (1, 1))
    plan = CapturePlan(camera_size_px=(1, 1), code=GrayCode(rows=False))
    dark = int(published_rig().sensor.black_level_dn)
    frames = tuple(np.full((1, 1), dark, np.uint16) for _ in plan.shots())
    with pytest.raises(DecodeError, match=r"pixels could be decoded|2 x 2"):
        pipeline.reconstruct(MemoryScan(plan, frames), rig)
