"""What results say that lack a variable, and of places that hold a single pixel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import dsl_core as dsl
from dsl_core.cli import main
from dsl_core.errors import StoreError
from tests.cases.small_result import small_result


@pytest.fixture
def result(tmp_path: Path) -> xr.Dataset:
    return dsl.load_result(dsl.save_result(small_result(), tmp_path / "whole.zarr"))


def test_a_region_of_one_pixel_states_what_is_stated_for_it(result: xr.Dataset, tmp_path: Path) -> None:
    pixel, other = result.dsl.spectrum(4, 2), result.dsl.spectrum(6, 3)
    region = result.dsl.region((4, 2, 1, 1))
    np.testing.assert_allclose(region["reflectance_std"], pixel["reflectance_std"])
    for name in ("most_sigmas", "differ"):
        found, known = (each.dsl.difference(other).attrs[name] for each in (region, pixel))
        assert found == pytest.approx(known)
    region.dsl.export(tmp_path / "region.csv")
    text = (tmp_path / "region.csv").read_text("utf-8")
    assert "deviation of its pixels" not in text
    assert "uncertainty of a pixel" in text


@pytest.mark.parametrize("name", ["reflectance_std", "data_share", "flags", "depth_std_mm", "depth_mm"])
def test_what_a_result_does_not_state_is_unknown_and_the_rest_is_told(
    result: xr.Dataset, tmp_path: Path, name: str
) -> None:
    less = result.drop_vars(name)
    for found, known in (
        (less.dsl.spectrum(4, 3), result.dsl.spectrum(4, 3)),
        (less.dsl.region((1, 1, 3, 2)), result.dsl.region((1, 1, 3, 2))),
    ):
        np.testing.assert_array_equal(found["reflectance"], known["reflectance"])
        assert set(found.data_vars) == set(known.data_vars)
    is_known = name != "reflectance_std"
    assert bool(less.dsl.spectrum(4, 3)["reflectance_std"].notnull().all()) is is_known
    for deviation in ("pixel_std", "mean_std"):
        assert bool(less.dsl.region((1, 1, 3, 2))[deviation].notnull().all()) is is_known
    assert bool(less.dsl.spectrum(4, 3)["data_share"].notnull().all()) is (name != "data_share")
    assert less.dsl.reasons(4, 3) == []
    assert bool(less.dsl.reasons(4, 2)) is (name != "flags")
    assert bool(less.dsl.reasons(3, 0))
    assert less.dsl.points().sizes == {**result.dsl.points().sizes}
    assert not less.dsl.good[0, 3]
    path = dsl.save_result(less, tmp_path / "less.zarr")
    places = ["--at", "pixel=4,3", "--at", "region=1,1,3,2"]
    assert main(["spectra", str(path), *places, "-o", str(tmp_path / "a.csv")]) == 0
    assert dsl.read_spectra(tmp_path / "a.csv")["pixel"].notnull().all()


def test_what_was_made_of_a_file_of_spectra_is_noted(tmp_path: Path) -> None:
    """A script shows no messages: values that are a hundredth of those in the file must say so."""
    rows = [f"{nm},{20 + nm / 100},{-999 if nm == 500 else 90}" for nm in range(400, 701, 10)]
    (tmp_path / "percent.csv").write_text("\n".join(("nm,leaf,tile", *rows)))
    (tmp_path / "shares.csv").write_text("\n".join(("nm,leaf", *(f"{nm},0.2" for nm in range(400, 701, 10)))))
    found = dsl.read_spectra(tmp_path / "percent.csv")
    for each in found.values():
        deleted, percent = each.attrs["notes"]
        assert "taken as deleted: 1" in deleted
        assert percent == "values up to 90 are read as percent."
    (plain,) = dsl.read_spectra(tmp_path / "shares.csv").values()
    assert plain.attrs["notes"] == []


def test_bands_alone_are_a_result_as_well(result: xr.Dataset) -> None:
    less = result[["reflectance"]]
    assert (
        less.dsl.good.values.tolist() == result["reflectance"].notnull().all("wavelength_nm").values.tolist()
    )
    assert less.dsl.spectrum(4, 3).attrs["reasons"] == []


@pytest.mark.parametrize(
    "ask",
    [
        *(
            lambda r, f, ending=ending: dsl.export(
                r.drop_vars("rgb"), f / f"a{ending}", pixels=[(4, 2)] if ending == ".csv" else []
            )
            for ending in (".ply", ".png", ".csv", ".hdr", ".exr")
        ),
        lambda r, _: r.dsl.region((1, 1, 3, 2)),
        lambda r, _: dsl.classify(r, pins={"a": (1, 1, 3, 2)}, measure="angle"),
        lambda r, _: dsl.colours(r, {"a": (1, 1, 3, 2)}, "D65"),
    ],
)
@pytest.mark.parametrize("is_said", [False, True])
def test_bands_that_a_result_does_not_say_the_wavelengths_of_are_not_counted(
    tmp_path: Path, ask: Callable[[xr.Dataset, Path], object], is_said: bool
) -> None:
    result = small_result()
    last = {"wavelength_nm": np.append(result["wavelength_nm"].values[:-1], np.nan)}
    unsaid = result.assign_coords(last) if is_said else result.drop_vars("wavelength_nm")
    with pytest.raises(StoreError, match=r"not one wavelength for each of its bands|needs .*wavelength_nm"):
        ask(unsaid, tmp_path)
    assert not list(tmp_path.iterdir())
