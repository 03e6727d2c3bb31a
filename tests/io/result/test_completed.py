"""Results of other programs: what they do not hold is unknown and named, and never an exception."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from dsl_core.errors import StoreError
from dsl_core.io.result.completed import completed, missing_text
from dsl_core.io.result.result_arrays import load_arrays
from dsl_core.io.result.result_file import save_result
from dsl_core.model.result import build_result

NM = np.array([450.0, 550.0, 650.0])
CUBE = np.linspace(0, 1, 3 * 4 * 5, dtype=np.float32).reshape(3, 4, 5)


def of(folder: Path, result: xr.Dataset) -> Path:
    return save_result(result, folder / "a.zarr")


def test_spectra_without_anything_else_have_colours_and_say_what_is_not_there(tmp_path: Path) -> None:
    result = completed(load_arrays(of(tmp_path, build_result({"reflectance": CUBE}, NM, {}))))
    assert result.shape == (4, 5)
    assert np.isnan(result["depth_mm"]).all()
    assert result["points_mm"].shape == (3, 4, 5)
    assert result["rgb"].shape == (3, 4, 5)
    assert result["data_share"].shape == CUBE.shape
    assert set(result.missing) == {
        *("depth_mm", "depth_std_mm", "points_mm", "flags", "reflectance_std", "data_share", "reach")
    }
    assert result.known("flags") is None
    assert result.known("reflectance") is result["reflectance"]
    assert "standard deviation of depth" in missing_text(result)
    # What is put in has no memory of its own.
    assert result["reflectance_std"].strides == (0, 0, 0)


def test_depth_alone_lacks_nothing_of_bands(tmp_path: Path) -> None:
    arrays = {"depth_mm": CUBE[0], "depth_std_mm": CUBE[0], "points_mm": CUBE, "flags": CUBE[0].astype("u2")}
    result = completed(load_arrays(of(tmp_path, build_result(arrays, NM, {}))))
    assert result.missing == ()
    assert missing_text(result) == ""
    unknown = replace(result, arrays={**result.arrays, "depth_mm": np.full((4, 5), np.nan, np.float32)})
    assert missing_text(unknown) == "No pixel of this result has a depth."
    assert "reach" not in result.arrays


def test_bands_that_the_eye_does_not_see_are_said_to_hold_no_colour(tmp_path: Path) -> None:
    nm = np.arange(450.0, 651.0, 20.0)
    cube = np.broadcast_to(CUBE[:1], (nm.size, 4, 5))
    seen = completed(load_arrays(of(tmp_path, build_result({"reflectance": cube}, nm, {}))))
    assert "colour" not in missing_text(seen)
    text = missing_text(replace(seen, wavelengths_nm=nm + 250))
    assert "The bands, 700 to 900 nm, hold too little of a colour" in text


def test_bands_rise_and_axes_are_in_their_order(tmp_path: Path) -> None:
    stored = build_result({"reflectance": CUBE, "depth_mm": CUBE[0]}, NM, {})
    result = load_arrays(
        of(tmp_path, stored.isel(wavelength_nm=[2, 0, 1]).transpose("x", "wavelength_nm", "y"))
    )
    assert result.wavelengths_nm.tolist() == NM.tolist()
    assert result["reflectance"] == pytest.approx(CUBE, abs=1e-4)
    assert result["depth_mm"].shape == (4, 5)


@pytest.mark.parametrize("wrong", ["axes", "no wavelengths", "twice"])
def test_what_cannot_be_shown_is_said(tmp_path: Path, wrong: str) -> None:
    result = build_result({"reflectance": CUBE, "depth_mm": CUBE[0]}, NM, {})
    if wrong == "axes":
        result = result.rename({"y": "rows"})
    elif wrong == "twice":
        result = result.assign_coords(wavelength_nm=[450.0, 550.0, 550.0])
    else:
        result = result.drop_vars("wavelength_nm")
    with pytest.raises(StoreError, match="along the axes" if wrong == "axes" else "one wavelength for each"):
        load_arrays(of(tmp_path, result))


def test_a_band_that_no_pixel_has_leaves_colours(tmp_path: Path) -> None:
    nm = np.arange(430.0, 661.0, 10.0)
    cube = np.broadcast_to(np.linspace(0.1, 0.6, nm.size)[:, None, None], (nm.size, 4, 5)).copy()
    whole = completed(load_arrays(of(tmp_path, build_result({"reflectance": cube}, nm, {}))))
    cube[11] = np.nan
    path = save_result(build_result({"reflectance": cube}, nm, {}), tmp_path / "lacking.zarr")
    lacking = completed(load_arrays(path))
    assert lacking["rgb"] == pytest.approx(whole["rgb"], abs=0.01)
    assert "colour" not in missing_text(lacking)
    cube[6:18] = np.nan
    path = save_result(build_result({"reflectance": cube}, nm, {}), tmp_path / "gap.zarr")
    assert "hold too little of a colour" in missing_text(completed(load_arrays(path)))
