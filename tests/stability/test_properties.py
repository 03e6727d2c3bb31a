"""What random scans and random bad values never do: leave a value that is no number without a flag."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import torch
import xarray as xr
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dsl_core.model.result import SPECTRUM_INVALID
from dsl_core.reconstruction.spectral.solving.lane_solver import solve_spectra
from dsl_core.reconstruction.spectral.solving.prior import Prior
from tests.stability.bench import Patch, Staged, comb_plan, grey, lines_plan, staged
from tests.stability.case import silent_values

#: The same examples every time, on any machine.
PROFILE = settings(max_examples=12, derandomize=True, deadline=None, database=None)
BAD = (np.nan, np.inf, -np.inf, 0.0, 1e-40, 1e-30, 1e30, 3e38, -1.0)
#: Where a value is planted: an array of a stage by its name.
PLACES = ("line radiance", "line deviation", "white radiance", "white variance")


@lru_cache(maxsize=2)
def _stage(comb: bool) -> Staged:
    return staged(Patch(plan=comb_plan(26) if comb else lines_plan(4), spectrum=grey(0.4)))


def planted(stage: Staged, place: str, value: float, share: float, seed: int) -> Staged:
    """A stage with a value at a share of the places of one of its arrays; what it hands on is not changed."""
    rng = np.random.default_rng(seed)
    parts = {
        "line radiance": stage.stack.radiance,
        "line deviation": stage.stack.std.astype(np.float32),
        "white radiance": stage.white.radiance,
        "white variance": stage.white.variance,
    }
    values = parts[place].copy()
    values[rng.random(values.shape) < share] = value
    with np.errstate(over="ignore"):
        stack = replace(
            stage.stack,
            radiance=values if place == "line radiance" else stage.stack.radiance,
            std=values if place == "line deviation" else stage.stack.std,
        )
    white = replace(
        stage.white,
        radiance=values if place == "white radiance" else stage.white.radiance,
        variance=values if place == "white variance" else stage.white.variance,
    )
    return replace(stage, stack=stack, white=white)


@pytest.mark.slow
@PROFILE
@given(
    comb=st.booleans(),
    place=st.sampled_from(PLACES),
    value=st.sampled_from(BAD),
    share=st.sampled_from((0.001, 0.05, 0.5, 1.0)),
    seed=st.integers(0, 9999),
)
def test_no_value_without_a_number_or_a_flag(
    comb: bool, place: str, value: float, share: float, seed: int
) -> None:
    stage = planted(_stage(comb), place, value, share, seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        result = stage.finish(torch.float32)
    assert silent_values(result) == []
    # Nor is what is given without deviation, below zero or beyond the solver's bounds.
    given_at = (result["flags"].values & int(SPECTRUM_INVALID)) == 0
    reflectance = result["reflectance"].values[:, given_at]
    std = result["reflectance_std"].values[:, given_at]
    known = np.isfinite(reflectance)
    assert (std[known] > 0).all()
    assert ((reflectance[known] >= 0) & (reflectance[known] <= 1.5)).all()


@PROFILE
@given(
    strength=st.floats(-6, 3),
    slope=st.floats(-4, 4),
    spike=st.floats(0, 1.4),
    seed=st.integers(0, 9999),
    dtype=st.sampled_from((torch.float32, torch.float64)),
)
@example(strength=-6.0, slope=4.0, spike=0.0, seed=0, dtype=torch.float32)
def test_solver_is_finite_bounded_and_never_surer_than_its_data(
    strength: float, slope: float, spike: float, seed: int, dtype: torch.dtype
) -> None:
    rng = np.random.default_rng(seed)
    bands, pixels = 40, 6
    x = np.linspace(0, 1, bands)
    information = 10 ** (2 * strength + slope * (x[:, None] - 0.5)) * rng.uniform(0.5, 2, (bands, pixels))
    truth = np.full((bands, pixels), 0.3)
    truth[rng.integers(2, bands - 2)] += spike
    data = torch.as_tensor(information[None]).to(dtype)
    values = truth + rng.standard_normal(truth.shape) / np.sqrt(information).clip(0.3)
    found = solve_spectra(data, data[0] * torch.as_tensor(values).to(dtype), None, Prior())
    for part in (found.mean, found.std, found.data_share, found.tau):
        assert bool(torch.isfinite(part).all())
    assert float(found.mean.min()) >= 0
    assert float(found.mean.max()) <= 1.5
    assert float(found.std.min()) > 0
    assert bool(((found.data_share >= 0) & (found.data_share <= 1)).all())


@lru_cache(maxsize=1)
def _usual() -> xr.Dataset:
    return _stage(False).finish(torch.float64)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [-20, -3, 8, 20])
def test_powers_of_two_change_nothing(factor: int) -> None:
    """Signal and deviation in another unit: the same spectra and flags."""
    stage = _stage(False)
    scale = np.float32(2.0**factor)
    stack = replace(
        stage.stack, radiance=stage.stack.radiance * scale, std=stage.stack.std.astype(np.float32) * scale
    )
    light = stage.white
    white = replace(light, radiance=light.radiance * scale, variance=light.variance * scale**2)
    rig = stage.rig.model_copy(update={"white_scale": stage.rig.white_scale * float(scale)})
    same = _usual()
    other = replace(stage, rig=rig, stack=stack, white=white).finish(torch.float64)
    difference = np.abs(other["reflectance"].values - same["reflectance"].values)
    assert np.nanmax(difference / same["reflectance_std"].values) < 1e-3
    assert np.array_equal(other["flags"].values, same["flags"].values)


@pytest.mark.slow
def test_the_property_sees_what_is_silent() -> None:
    result = _stage(False).finish(torch.float32)
    assert silent_values(result) == []
    y, x = np.argwhere(result["flags"].values == 0)[0]
    result["reflectance_std"][5, y, x] = np.nan
    assert silent_values(result) == ["reflectance_std"]
