from __future__ import annotations

import shutil
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zarr

from dsl_core.errors import Cancelled, StoreError
from dsl_core.io.result import result_arrays
from dsl_core.io.result.inventory import CHECKSUM, INVENTORY
from dsl_core.io.result.result_arrays import load_arrays
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.model.result import build_result
from dsl_core.progress import CallbackProgress, CancelToken

NM = np.arange(430.0, 661.0, 5.0)


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    random = np.random.default_rng(0)
    cube = random.random((NM.size, 120, 200), np.float32)
    cube[:, 3, 4] = np.nan
    arrays: dict[str, np.ndarray] = {
        "depth_mm": 900 * cube[0],
        "points_mm": cube[:3],
        "reflectance": cube,
        "reflectance_std": 0.01 * cube,
        "data_share": cube,
        "reach": np.ones(cube.shape, np.uint8),
        "flags": np.zeros(cube.shape[1:], np.uint16),
    }
    return save_result(build_result(arrays, NM, {"rig": "twin"}), tmp_path / "a.zarr")


def test_everything_is_there_as_plain_arrays(stored: Path) -> None:
    result = load_arrays(stored)
    assert result.shape == (120, 200)
    assert result.has_spectra
    assert result["reflectance"].dtype == result["data_share"].dtype == np.float32
    assert result["reach"].dtype == np.uint8
    assert result.at("reflectance", (4, 3)).shape == NM.shape
    assert np.isnan(result.at("reflectance", (4, 3))).all()
    assert result.at("points_mm", (1, 2)).shape == (3,)
    assert result.holds((199, 119))
    assert not result.holds((200, 0))
    assert result.attributes["rig"] == "twin"


def test_memory_stays_near_that_of_the_result(stored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(result_arrays, "AT_ONCE_BYTES", 400e3)  # four bands of this small one
    load_arrays(stored)  # what is imported on the way does not count
    tracemalloc.start()
    result = load_arrays(stored)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1.5 * sum(values.nbytes for values in result.arrays.values())


def test_reading_can_be_stopped(stored: Path) -> None:
    token = CancelToken()
    token.cancel()
    with pytest.raises(Cancelled):
        load_arrays(stored, CallbackProgress(lambda *_: None, token))


def test_arrays_are_the_values_of_the_data_set(stored: Path) -> None:
    arrays, result = load_arrays(stored), load_result(stored)
    assert set(arrays.arrays) <= set(result)
    for name, values in arrays.arrays.items():
        np.testing.assert_array_equal(values, result[name].values, err_msg=name)
        assert values.dtype == result[name].dtype, name
    np.testing.assert_array_equal(arrays.wavelengths_nm, result["wavelength_nm"].values)
    assert arrays.attributes == result.attrs


def test_reading_needs_neither_xarray_nor_pandas(stored: Path) -> None:
    """They take longer to import than the result takes to be read: a person waits for the first one."""
    code = (
        "import sys; from pathlib import Path; from dsl_core.io.result.result_arrays import load_arrays;"
        f"load_arrays(Path({str(stored)!r})); print({{'dask', 'pandas', 'xarray'}} & set(sys.modules))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "set()"


def test_an_axis_of_two_lengths_is_damage(stored: Path) -> None:
    shutil.rmtree(stored / "wavelength_nm")
    group = zarr.open_group(stored, mode="r+", zarr_format=3, use_consolidated=False)
    group.create_array(
        "wavelength_nm", data=NM[1:], dimension_names=["wavelength_nm"], compressors=None, overwrite=True
    )
    attributes = {k: v for k, v in group.attrs.items() if k not in (INVENTORY, CHECKSUM)}
    group.attrs.put(attributes)
    with pytest.raises(StoreError, match="along wavelength_nm"):
        load_arrays(stored)


def test_pixels_of_a_part_are_known_in_the_whole_picture(stored: Path, tmp_path: Path) -> None:
    whole = load_result(stored)
    assert load_arrays(stored).in_picture((3, 4)) == (3, 4)
    part = whole.isel(x=slice(100, 160, 2), y=slice(50, 90))
    arrays = load_arrays(save_result(part, tmp_path / "part.zarr"))
    assert arrays.origin_px == (100, 50)
    assert arrays.in_picture((3, 4)) == (106, 54)
    np.testing.assert_array_equal(arrays.at("reflectance", (3, 4)), whole["reflectance"].sel(x=106, y=54))


def test_coordinates_that_name_no_pixels_are_left_aside(stored: Path, tmp_path: Path) -> None:
    centres = load_result(stored).assign_coords(x=np.arange(200) + 0.5, y=np.zeros(120))
    arrays = load_arrays(save_result(centres, tmp_path / "centres.zarr"))
    assert arrays.in_picture((3, 4)) == (3, 4)


def test_a_finer_result_is_averaged_over_the_bands_of_a_coarser_one(stored: Path, tmp_path: Path) -> None:
    wide_nm, fine = np.arange(430.0, 661.0, 10.0), load_arrays(stored)
    arrays: dict[str, np.ndarray] = {"reflectance": np.zeros((wide_nm.size, 120, 200), np.float32)}
    wide = load_arrays(save_result(build_result(arrays, wide_nm, {}), tmp_path / "wide.zarr"))
    line = (fine.wavelengths_nm == 550).astype(np.float32)
    fine.arrays["reflectance"][:] = line[:, None, None]
    fine.arrays["reflectance"][-2, 0, 0] = np.nan
    found = fine.averaged_like(wide)
    assert (found.wavelengths_nm.tolist(), found.band_width_nm) == (wide_nm.tolist(), 10.0)
    assert "reach" not in found.arrays
    # A line in one band is as much light in a wider one; a band that is missing takes away those on it only.
    assert found["reflectance"][:, 3, 3].sum() * 10 == pytest.approx(5.0, rel=0.05)
    assert np.isnan(found["reflectance"][:, 0, 0]).sum() == 2
    assert wide.averaged_like(fine) is wide
    assert found.averaged_like(wide) is found
    few = replace(fine, wavelengths_nm=NM[::4], arrays={"reflectance": fine["reflectance"][::4]})
    assert few.averaged_like(wide) is few
