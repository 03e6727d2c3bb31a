"""Results survive the disk, band by band, and wrong folders are refused in one sentence."""

from __future__ import annotations

import json
import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from dsl_core.errors import StoreError
from dsl_core.io import staging
from dsl_core.io.result import result_file
from dsl_core.io.result.arrays import write_variable
from dsl_core.io.result.result_file import load_result, save_result
from tests.cases.small_result import UNLIT, WAVELENGTHS_NM, small_result

#: Half a step of the packed cubes (float32 rounding included); every other variable is exact.
HALF_STEP = {"reflectance": 2.6e-5, "reflectance_std": 2.6e-5, "data_share": 2.01e-3}


def test_everything_comes_back(tmp_path: Path) -> None:
    result = small_result()
    path = save_result(result, tmp_path / "result.zarr")
    loaded = load_result(path)
    assert set(loaded.variables) == set(result.variables)
    for name, variable in result.variables.items():
        again = loaded[name]
        assert again.dims == variable.dims
        if variable.dtype.kind in "UO":
            assert again.values.tolist() == variable.values.tolist()
            continue
        np.testing.assert_allclose(again, variable, rtol=0, atol=HALF_STEP.get(str(name), 0))
        assert again.attrs == variable.attrs
        assert again.dtype == (
            np.float32 if variable.dtype.kind == "f" and variable.ndim > 1 else variable.dtype
        )
    assert loaded.attrs == result.attrs


def test_plain_xarray_reads_it_without_this_package(tmp_path: Path) -> None:
    result = small_result()
    path = save_result(result, tmp_path / "result.zarr")
    with xr.open_zarr(path, chunks=None, consolidated=False) as plain:
        for name, tolerance in HALF_STEP.items():
            np.testing.assert_allclose(plain[name], result[name], rtol=0, atol=tolerance)
        np.testing.assert_array_equal(plain["wavelength_nm"], WAVELENGTHS_NM)
        assert plain["depth_mm"].attrs["units"] == "mm"


def test_what_plain_xarray_read_is_saved_and_loaded_like_any_result(tmp_path: Path) -> None:
    """Its attributes hold inventory, checksum and labels of the folder that it was read from."""
    saved = load_result(save_result(small_result(), tmp_path / "a.zarr"), lazy=False)
    part = xr.open_zarr(tmp_path / "a.zarr").isel(x=slice(1, None))
    again = load_result(save_result(part, tmp_path / "b.zarr"), lazy=False)
    xr.testing.assert_identical(again, saved.isel(x=slice(1, None)))


def test_maps_take_single_precision_on_disk_and_axes_keep_theirs(tmp_path: Path) -> None:
    result = small_result()
    result["depth_mm"] = result["depth_mm"].astype(np.float64)
    path = save_result(result, tmp_path / "result.zarr")
    assert load_result(path)["depth_mm"].dtype == np.float32
    assert load_result(path)["wavelength_nm"].dtype == result["wavelength_nm"].dtype


def test_one_band_is_read_without_its_neighbours(tmp_path: Path) -> None:
    import zarr

    path = save_result(small_result(), tmp_path / "result.zarr")
    stored = zarr.open_array(path / "reflectance", mode="r")
    assert stored.chunks == (1, 6, 9)
    lazy = load_result(path)
    assert not lazy["reflectance"].variable._in_memory
    np.testing.assert_allclose(lazy["reflectance"][2], small_result()["reflectance"][2], atol=2.6e-5)
    assert load_result(path, lazy=False)["reflectance"].variable._in_memory


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("reflectance", 5.0),
        ("reflectance_std", np.inf),
        # The integers that stand for NaN.
        ("reflectance", -32768 * 5e-5),
        ("reflectance_std", 65535 * 5e-5),
        ("data_share", 255 / 250),
    ],
)
def test_values_outside_the_integer_range_are_kept_as_float(tmp_path: Path, name: str, value: float) -> None:
    result = small_result()
    result[name][0, 2, 2] = value
    loaded = load_result(save_result(result, tmp_path / "r.zarr"))
    np.testing.assert_array_equal(loaded[name], result[name])


def test_a_pixel_is_read_from_a_result_with_other_axes(tmp_path: Path) -> None:
    usual, kept = small_result(), {"x": 2, "y": 1}
    there = load_result(save_result(usual, tmp_path / "usual.zarr")).isel(kept)
    turned = load_result(save_result(usual.transpose(..., "y"), tmp_path / "turned.zarr")).isel(kept)
    xr.testing.assert_identical(turned.load(), there.load())


@pytest.mark.parametrize("value", [datetime(2026, 1, 1, tzinfo=UTC), Path("a"), b"a", {1}])
@pytest.mark.parametrize("on", ["result", "variable"])
def test_an_attribute_that_no_file_can_hold_is_named(tmp_path: Path, value: object, on: str) -> None:
    result = small_result()
    (result if on == "result" else result["depth_mm"]).attrs["mine"] = value
    with pytest.raises(StoreError, match=r"attribute 'mine' of the result cannot be saved .* not JSON"):
        save_result(result, tmp_path / "a.zarr")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("axis", ["wavelength_nm", "x"])
def test_a_result_of_nothing_is_not_stored(tmp_path: Path, axis: str) -> None:
    with pytest.raises(StoreError, match=f"is empty along {axis}"):
        save_result(small_result().isel({axis: slice(0, 0)}), tmp_path / "a.zarr")


def test_a_cube_of_nothing_but_nan_stays_nan(tmp_path: Path) -> None:
    result = small_result()
    result["reflectance"][...] = np.nan
    assert np.isnan(load_result(save_result(result, tmp_path / "r.zarr"))["reflectance"]).all()


def test_a_depth_only_result(tmp_path: Path) -> None:
    result = small_result()[["depth_mm", "flags"]]
    loaded = load_result(save_result(result, tmp_path / "r.zarr"))
    assert set(loaded.variables) == {"depth_mm", "flags", "x", "y"}
    assert np.isnan(loaded["depth_mm"].values[UNLIT])


def test_an_existing_result_is_replaced_only_when_allowed(tmp_path: Path) -> None:
    path = save_result(small_result(), tmp_path / "r.zarr")
    with pytest.raises(StoreError, match="already exists"):
        save_result(small_result(), path)
    changed = small_result()
    changed["depth_mm"][0, 0] = 123.0
    save_result(changed, path, overwrite=True)
    assert load_result(path)["depth_mm"].values[0, 0] == 123.0
    assert [p.name for p in tmp_path.iterdir()] == ["r.zarr"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_a_write_that_breaks_off_leaves_the_old_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException | type[BaseException]
) -> None:
    path = save_result(small_result(), tmp_path / "r.zarr")
    original = write_variable

    def fail_at_reflectance(group: object, name: str, variable: object) -> None:
        if name == "reflectance":
            raise error
        original(group, name, variable)  # type: ignore[arg-type]

    monkeypatch.setattr(result_file, "write_variable", fail_at_reflectance)
    changed = small_result()
    changed["depth_mm"][0, 0] = 123.0
    with pytest.raises((KeyboardInterrupt, StoreError), match=r"^$|disk is full"):
        save_result(changed, path, overwrite=True)
    assert load_result(path)["depth_mm"].values[0, 0] != 123.0
    assert [p.name for p in tmp_path.iterdir()] == ["r.zarr"]


def test_the_old_result_returns_when_the_last_rename_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = save_result(small_result(), tmp_path / "r.zarr")
    real = os.replace

    def last_step_fails(source: Path, target: Path) -> None:
        if target == path and not str(source).endswith(".old"):
            raise PermissionError(13, "Permission denied")
        real(source, target)

    monkeypatch.setattr(staging, "exchange", lambda one, other: False)
    monkeypatch.setattr(os, "replace", last_step_fails)
    with pytest.raises(StoreError, match="permissions"):
        save_result(small_result(), path, overwrite=True)
    assert load_result(path).sizes["wavelength_nm"] == 5


def _edit(path: Path, **attributes: object) -> None:
    content = json.loads((path / "zarr.json").read_text())
    content["attributes"].update(attributes)
    (path / "zarr.json").write_text(json.dumps(content))


def test_another_schema_version_is_refused(tmp_path: Path) -> None:
    path = save_result(small_result(), tmp_path / "r.zarr")
    _edit(path, schema_version=2)
    with pytest.raises(StoreError, match=r"schema version 2; this program supports version 1.*reconstruct"):
        load_result(path)
    with pytest.raises(StoreError, match="schema version 7"):
        save_result(small_result().assign_attrs(schema_version=7), tmp_path / "other.zarr")
    with pytest.raises(StoreError, match="without schema_version"):
        save_result(xr.Dataset(), tmp_path / "other.zarr")


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda p: (p / "zarr.json").write_text("{"), "damaged"),
        (lambda p: (p / "zarr.json").write_text("[]"), "damaged"),
        (lambda p: (p / "zarr.json").unlink(), "not a result"),
        (lambda p: (p / "depth_mm" / "zarr.json").write_text("{"), "damaged"),
        (lambda p: (p / "reflectance" / "c" / "0" / "0" / "0").write_bytes(b"x" * 9), "damaged"),
    ],
)
def test_damaged_results_end_in_one_sentence(tmp_path: Path, damage: object, says: str) -> None:
    path = save_result(small_result(), tmp_path / "r.zarr")
    damage(path)  # type: ignore[operator]
    with pytest.raises(StoreError, match=says):
        load_result(path, lazy=False)


def test_a_path_that_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(StoreError, match="not a result"):
        load_result(tmp_path / "file")
    with pytest.raises(StoreError, match="is a file, not a folder"):
        save_result(small_result(), tmp_path / "file" / "r.zarr")


def test_one_file_describes_all_arrays_of_a_result(tmp_path: Path) -> None:
    import zarr

    path = save_result(small_result(), tmp_path / "result.zarr")
    described = zarr.open_group(path, mode="r").metadata.consolidated_metadata
    assert described is not None
    assert {"depth_mm", "reflectance", "flags"} <= set(described.metadata)
