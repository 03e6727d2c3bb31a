"""Results whose axes, bands, rows or columns are stored in another order say the same."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import dsl_core as dsl
from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.result.result_arrays import load_arrays
from dsl_core.model.result import Flag, build_result
from dsl_core.model.result_order import canonical, with_axes
from dsl_core.model.spectral import SpectralCurve, at_bands
from tests.cases.small_result import OF_COLOUR_NM, small_result

Change = Callable[[xr.Dataset], xr.Dataset]
CHANGES: dict[str, Change] = {
    "bands fall": lambda result: result.isel(wavelength_nm=slice(None, None, -1)),
    "bands are shuffled": lambda result: xr.concat(
        [result.isel(wavelength_nm=slice(1, None, 2)), result.isel(wavelength_nm=slice(0, None, 2))],
        "wavelength_nm",
        data_vars="minimal",
    ),
    "other axes": lambda result: result.transpose("x", "y", ...),
    "upside down": lambda result: result.isel(y=slice(None, None, -1)),
    "mirrored": lambda result: result.isel(x=slice(None, None, -1)),
    "all": lambda result: result[dict.fromkeys(("wavelength_nm", "y", "x"), slice(None, None, -1))].transpose(
        "y", "x", ...
    ),
}
PLACES = {"a": (1, 1, 3, 2), "b": (6, 3)}


@pytest.fixture(params=CHANGES)
def changed(request: pytest.FixtureRequest) -> xr.Dataset:
    return CHANGES[request.param](small_result())


def test_a_loaded_result_has_the_order_relied_on(changed: xr.Dataset, tmp_path: Path) -> None:
    path, usual = dsl.save_result(changed, tmp_path / "a.zarr"), small_result()
    saved = dsl.load_result(dsl.save_result(usual, tmp_path / "usual.zarr"))
    found, arrays = dsl.load_result(path), load_arrays(path)
    xr.testing.assert_equal(found, saved)
    for name, values in arrays.arrays.items():
        assert found[name].dims == usual[name].dims
        np.testing.assert_array_equal(values, saved[name].values, err_msg=name)
    np.testing.assert_array_equal(arrays.wavelengths_nm, usual["wavelength_nm"].values)
    assert arrays.in_picture((2, 1)) == (2, 1)


@pytest.mark.parametrize("ending", [".ply", ".stl", ".hdr", ".csv", ".npy"])
def test_exports_are_the_same(changed: xr.Dataset, tmp_path: Path, ending: str) -> None:
    pixels = [(4, 2)] if ending == ".csv" else []
    for name, result in (("changed", changed), ("usual", small_result())):
        folder = tmp_path / name
        folder.mkdir()
        dsl.export(result, folder / f"a{ending}", pixels=pixels)
    files = sorted((tmp_path / "usual").iterdir())
    assert files
    for file in files:
        assert file.read_bytes() == (tmp_path / "changed" / file.name).read_bytes(), file.name


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_answers_are_the_same(change: Change) -> None:
    usual = small_result(OF_COLOUR_NM)
    changed = change(usual)
    xr.testing.assert_allclose(
        dsl.colours(changed, PLACES, "D65", "a"), dsl.colours(usual, PLACES, "D65", "a"), rtol=1e-6
    )
    found, known = (dsl.classify(each, pins=PLACES, measure="angle") for each in (changed, usual))
    xr.testing.assert_allclose(found.sortby(["y", "x"]), known, rtol=1e-5)
    xr.testing.assert_allclose(changed.dsl.region(PLACES["a"]), usual.dsl.region(PLACES["a"]), rtol=1e-6)
    points, all_points = (each.dsl.points().sortby(["y", "x"]) for each in (changed, usual))
    xr.testing.assert_equal(points["depth_mm"].drop_vars("point", errors="ignore"), all_points["depth_mm"])


def test_a_mask_marks_rows_as_they_are_given(changed: xr.Dataset) -> None:
    mask = np.zeros((changed.sizes["y"], changed.sizes["x"]), bool)
    mask[1, 2] = True
    x, y = int(changed["x"][2]), int(changed["y"][1])
    found = changed.dsl.region(mask)["reflectance"].sortby("wavelength_nm")
    np.testing.assert_allclose(found, small_result()["reflectance"].sel(x=x, y=y), rtol=1e-6)


def test_what_is_in_order_is_left_as_it_is() -> None:
    usual = small_result()
    assert canonical(usual) is usual
    bare = usual.drop_vars(["x", "y"])
    assert canonical(bare) is bare
    spectrum = usual.dsl.spectrum(4, 2)
    assert with_axes(spectrum) is spectrum


def test_masking_leaves_whole_flags_that_tell_what_is_taken_away(tmp_path: Path) -> None:
    usual = small_result()
    masked = usual.where(usual.dsl.good)
    assert masked["flags"].dtype.kind == "f"
    good = usual.dsl.good.values
    old = masked.assign(flags=masked["flags"].astype(np.float32))
    for each in (masked, dsl.load_result(dsl.save_result(old, tmp_path / "a.zarr"))):
        assert each.dsl.points().sizes["point"] == good.sum()
        assert each.dsl.spectrum(0, 0).attrs["reasons"] == []
        assert "not a finite number" in each.dsl.spectrum(4, 2).attrs["reasons"][0]
        shown = dsl.classify(each, pins=PLACES, measure="angle")["class"].values
        assert (shown[~good] == 0).all()
        assert (shown[good] > 0).all()
        dsl.export(each, tmp_path / "a.npy", overwrite=True)
        np.testing.assert_array_equal(
            np.load(tmp_path / "a_flags.npy"), np.where(good, usual["flags"], Flag.NON_FINITE)
        )
        dsl.export(each, tmp_path / "a.stl", overwrite=True)
        dsl.export(each, tmp_path / "a.csv", pixels=[(4, 2), (0, 0)], overwrite=True)
    stored = load_arrays(tmp_path / "a.zarr")
    assert [str(stored[name].dtype) for name in ("flags", "reach")] == ["uint16", "uint8"]


def test_averaged_flags_are_refused_with_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    groups = small_result().coarsen(x=2, y=2, boundary="trim")
    averaged = groups.mean()
    # The one warning of four pixels, 64, averages to the whole number of another.
    assert float(averaged["flags"][1, 2]) == 16
    uses: list[Callable[[], object]] = [
        lambda: dsl.save_result(averaged, tmp_path / "a.zarr"),
        lambda: dsl.export(averaged, tmp_path / "a.tiff"),
        lambda: dsl.classify(averaged, pins=PLACES, measure="angle"),
        lambda: averaged.dsl.points(),
        lambda: averaged.dsl.good,
        lambda: averaged.dsl.reasons(float(averaged["x"][2]), float(averaged["y"][1])),
    ]
    for use in uses:
        with pytest.raises(StoreError, match=r"flags of the result .* averages, such as [\d.]+\. .*\.max"):
            use()
    assert not list(tmp_path.iterdir())
    with monkeypatch.context() as before:
        before.setattr("dsl_core.io.result.result_file.with_bits", lambda result: result)
        path = dsl.save_result(averaged, tmp_path / "a.zarr")
    for load in (dsl.load_result, load_arrays):
        with pytest.raises(StoreError, match="averages"):
            load(path)
    largest = averaged.assign(groups.max()[["flags", "reach"]])
    for kept in (largest, averaged.drop_vars(["flags", "reach"])):
        assert kept.dsl.points().sizes["point"]
        assert load_arrays(dsl.save_result(kept, tmp_path / "b.zarr", overwrite=True)).shape == (3, 4)
    assert not bool(largest.dsl.good[1, 2])


def test_bands_can_be_averaged_without_what_reached_them() -> None:
    averaged = small_result().coarsen(wavelength_nm=2, boundary="trim").mean()
    averaged["reach"][0, 1, 1] = 0.5
    with pytest.raises(StoreError, match=r"reach of the result .*drop_vars\('reach'\)"):
        averaged.dsl.region(PLACES["a"])
    assert averaged.drop_vars("reach").dsl.region(PLACES["a"]).attrs["used"] == 6


def test_results_saved_with_floats_as_flags_are_read_with_whole_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = small_result()
    with monkeypatch.context() as before:
        before.setattr("dsl_core.io.result.result_file.with_bits", lambda result: result)
        path = dsl.save_result(usual.where(usual.dsl.good), tmp_path / "a.zarr")
    assert dsl.load_result(path)["flags"].dtype == np.uint16
    stored = load_arrays(path)
    assert [str(stored[name].dtype) for name in ("flags", "reach")] == ["uint16", "uint8"]
    np.testing.assert_array_equal(stored["flags"] == 0, usual.dsl.good)


def test_a_spectrum_of_another_instrument_is_averaged_over_bands_in_any_order(
    changed: xr.Dataset, tmp_path: Path
) -> None:
    result = dsl.load_result(dsl.save_result(changed, tmp_path / "a.zarr"))
    fine = np.arange(300.0, 801.0)
    line = xr.DataArray((fine == 550) * 1.0, {"wavelength_nm": fine}, ("wavelength_nm",))
    means = CHANGES["bands fall"](result).dsl.at_bands(line)
    # Of these bands nobody says how wide they are: as far as they are apart.
    width_nm = (655.0 - 432.5) / 2
    assert float(means.sel(wavelength_nm=550)) == pytest.approx(1 / width_nm, rel=0.1)
    assert (result["reflectance"] - means).sizes == result["reflectance"].sizes


def test_a_spectrum_is_averaged_as_far_as_it_is_known_and_nothing_else_is(tmp_path: Path) -> None:
    accessor = dsl.load_result(dsl.save_result(small_result(), tmp_path / "a.zarr")).dsl
    fine = np.arange(400.0, 701.0)
    line = xr.DataArray(fine / 1000, {"wavelength_nm": fine}, ("wavelength_nm",))
    holed = line[::-1].where(line["wavelength_nm"] != 690)
    xr.testing.assert_allclose(accessor.at_bands(holed), accessor.at_bands(line))
    own = accessor.spectrum(2, 1)
    np.testing.assert_allclose(accessor.at_bands(own["reflectance"]), own["reflectance"], atol=1e-5)
    wrongs = own, "tile.csv", np.ones(301), line.expand_dims(x=2), line.drop_vars("wavelength_nm")
    for wrong in wrongs:
        with pytest.raises(CalibrationError, match="not one spectrum"):
            accessor.at_bands(wrong)
    with pytest.raises(CalibrationError, match="not all different"):
        accessor.at_bands(xr.concat([line, line], "wavelength_nm"))


def test_a_spectrum_of_finer_bands_is_averaged_before_it_is_subtracted(tmp_path: Path) -> None:
    fine = np.arange(400.0, 701.0)
    edge = SpectralCurve.of(fine, np.where(fine > 575, 0.6, 0.05))
    regions = []
    for step_nm in (5.0, 10.0):
        nm = np.arange(430.0, 661.0, step_nm)
        uneven = np.linspace(0.99, 1.01, 16).reshape(4, 4)
        cube = (at_bands(edge, nm).values[:, None, None] * uneven).astype(np.float32)
        result = build_result({"reflectance": cube, "reflectance_std": np.full_like(cube, 0.01)}, nm, {})
        loaded = dsl.load_result(dsl.save_result(result, tmp_path / f"{step_nm:g}.zarr"))
        regions.append(loaded.dsl.region((0, 0, 4, 4)))
    for one, other in (regions, regions[::-1]):
        less = one.dsl.difference(other)
        assert less["reflectance"].size == 24
        assert float(np.abs(less["reflectance"]).max()) < 0.01
