"""Part results of the twin are compared with the truth of their own part and bands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import dsl_core as dsl
from dsl_core import pipeline
from dsl_core.errors import DecodeError, StoreError
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.workflows.series import read_sweep
from dsl_core.workflows.truths import truth_of, twin_truth
from tests.app.support.compare_bench import make_result


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    return load_result(make_result(tmp_path_factory.mktemp("parts"), "chart"), lazy=False)


def test_a_part_has_the_truth_of_its_place(whole: xr.Dataset) -> None:
    every, part = truth_of(whole), whole.isel(x=slice(20, 50, 2), y=slice(30, 10, -1))
    here = truth_of(part)
    assert every.depth_mm is not None
    assert here.depth_mm is not None
    np.testing.assert_array_equal(here.depth_mm, every.depth_mm[30:10:-1, 20:50:2])
    found, known = dsl.evaluate(part), dsl.evaluate(whole)
    assert found.depth is not None
    assert known.depth is not None
    assert found.depth.rmse_mm < 2 * known.depth.rmse_mm


def test_options_replace_those_of_the_scan_and_leave_others(whole: xr.Dataset) -> None:
    """The truth of another scene must not be that of the scan's, without a word."""
    own, other = truth_of(whole), truth_of(whole, options={"scene": "plane"})
    assert own.size_px == other.size_px
    assert set(other.names) != set(own.names)


@pytest.mark.parametrize("bands", [[20], [3, 30], [0, 1, 5, 40]])
def test_bands_are_those_of_the_result(whole: xr.Dataset, bands: list[int]) -> None:
    some, every = whole.isel(wavelength_nm=bands), truth_of(whole)
    here = truth_of(some)
    assert here.spectra is not None
    assert every.spectra is not None
    np.testing.assert_allclose(here.spectra, every.spectra[:, bands], atol=1e-12)
    assert dsl.evaluate(some).mean("rmse") < 2 * dsl.evaluate(whole).mean("rmse")


def test_bands_without_wavelengths_are_told_before_their_truth_is_made(whole: xr.Dataset) -> None:
    nm = np.append(whole["wavelength_nm"].values[:-1], np.nan)
    for unsaid in (whole.assign_coords(wavelength_nm=nm), whole.drop_vars("wavelength_nm")):
        with pytest.raises(StoreError, match="not one wavelength for each of its bands"):
            dsl.evaluate(unsaid)


@pytest.mark.parametrize("step_nm", [5.0, 10.0])
def test_the_truth_is_averaged_over_bands_as_results_are(step_nm: float) -> None:
    with dsl.open_rig("twin", size="48x32", scene="filters") as rig:
        found = twin_truth(rig, WavelengthGrid(step_nm=step_nm))
        fine = twin_truth(rig, WavelengthGrid(step_nm=1.0))
    assert found is not None
    assert found.spectra is not None
    assert fine is not None
    assert fine.spectra is not None
    lines = list(found.targets or ())
    # Lines of 10 nm keep their area in bands of any width, and lose their height.
    np.testing.assert_allclose(found.spectra[lines].sum(1) * step_nm, fine.spectra[lines].sum(1), rtol=0.03)
    peak = {5.0: 0.79, 10.0: 0.65}[step_nm]
    assert found.spectra[lines].max() < peak < fine.spectra[lines].max()


def test_a_part_that_does_not_say_where_it_is_is_refused(whole: xr.Dataset) -> None:
    nowhere = whole.isel(x=slice(20, 50)).drop_vars("x")
    with pytest.raises(DecodeError, match="render the truth for the camera"):
        dsl.evaluate(nowhere)
    other = {"size": "128x96", "scene": "color-checker"}
    with pytest.raises(DecodeError, match="render the truth for the camera"):
        pipeline.evaluate(whole, truth_of(whole, "twin", other))


@pytest.mark.parametrize("step", [{"x": 2}, {"y": 4}, {"x": 2, "y": 2}])
def test_averaged_pixels_are_told_instead_of_the_camera(whole: xr.Dataset, step: dict[str, int]) -> None:
    means = whole.drop_vars(["flags", "reach"]).coarsen(step, boundary="trim").mean()
    with pytest.raises(DecodeError, match=r"are averages, with [xy] from [01].5, .* before you average"):
        dsl.evaluate(means.assign_attrs(whole.attrs))


def test_middles_of_pixels_are_the_pixels_where_all_are_there(whole: xr.Dataset) -> None:
    middles = whole.assign_coords(x=whole["x"] + 0.5, y=whole["y"] + 0.5)
    assert dsl.evaluate(middles).mean("rmse") == dsl.evaluate(whole).mean("rmse")


def test_a_sweep_compares_one_part_with_the_truth(whole: xr.Dataset, tmp_path: Path) -> None:
    def saved(name: str, left: int) -> Path:
        return save_result(whole.isel(x=slice(left, left + 30)), tmp_path / f"{name}.zarr")

    first, second, other = saved("first", 10), saved("second", 10), saved("other", 30)
    points, _ = read_sweep([first, second])
    assert points[0].depth_mm == points[1].depth_mm
    with pytest.raises(DecodeError, match="all of the same part"):
        read_sweep([first, other])
