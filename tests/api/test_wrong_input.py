"""What scripts give by mistake: every failure is one of `dsl_core.errors`."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import dsl_core as dsl
import dsl_core.api.accessor
from dsl_core.api.scans import _device, _grid, _region
from dsl_core.errors import CalibrationError, DecodeError, DeviceError, PlanError, StoreError
from tests.cases.small_result import small_result

Ask = Callable[[xr.Dataset], Any]


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (
            lambda r: r.isel(wavelength_nm=3).dsl.spectrum(4, 2),
            r"one band, .* result.isel\(wavelength_nm=\[3\]",
        ),
        (
            lambda r: r.rename(wavelength_nm="wl").dsl.spectrum(4, 2),
            "no axis wavelength_nm; its reflectance is over wl, y, x",
        ),
        (lambda r: r.isel(wavelength_nm=3).dsl.region((1, 1, 3, 2)), "has one band"),
        (lambda r: r.isel(y=3).dsl.points(), r"has no axis y, .* result.isel\(y=\[30\]\)"),
        (lambda r: r.isel(y=3).dsl.region((1, 3, 3, 1)), "has no axis y"),
        (lambda r: r.isel(x=3).dsl.spectrum(3, 2), "has no axis x"),
        (lambda r: r.rename(x="col").dsl.spectrum(3, 2), r"pixels are over col. .* result.rename\(col='x'\)"),
        (lambda r: xr.concat([r, r], "scan").dsl.spectrum(3, 2), r"one more axis .* result.isel\(scan=0\)"),
        (lambda r: r.dsl.plot(4, 2, ax="a"), "what was given is of type str"),
        (lambda _: xr.Dataset().dsl.good, "no flags, no depth and no spectra"),
        (lambda r: dsl.colours(r.isel(y=3), {"a": (1, 3)}), "has no axis y"),
        (lambda r: dsl.classify(r.isel(y=3), pins={"a": (1, 3)}), "has no axis y"),
        (lambda r: r.dsl.spectrum(4, 2).dsl.points(), "one spectrum, not a result"),
        (lambda r: r.dsl.spectrum(4, 2).dsl.region((1, 1, 2, 2)), "one spectrum, not a result"),
        (lambda r: r.dsl.spectrum([4, 5], 2), r"A pixel is two numbers, x and y; given \[4, 5\] and 2"),
        (lambda r: r.dsl.spectrum(slice(0, 3), 2), "A pixel is two numbers"),
        (lambda r: r.dsl.region((1, 1, float("inf"), 2)), "in whole pixels"),
        (lambda r: r.dsl.region([(1, 2), (3,)]), "in whole pixels"),
        (lambda r: r.dsl.region(r), r"in whole pixels; given <xarray\.Dataset> [^\n]*\.$"),
        (lambda r: r[["depth_mm", "flags"]].dsl.plot(x=4, y=2), "contains depth only"),
    ],
)
def test_a_part_of_a_result_says_what_it_lacks(ask: Ask, words: str) -> None:
    with pytest.raises(DecodeError, match=words):
        ask(small_result())


@pytest.mark.parametrize(
    "ask",
    [
        lambda r, path: dsl.evaluate(path),
        lambda r, path: dsl.export(path, "a.csv"),
        lambda r, path: dsl.save_result(path, "a.zarr"),
        lambda r, path: dsl.classify(path, pins={"a": (1, 3)}),
        lambda r, path: dsl.colours(path, {"a": (1, 3)}),
        lambda r, path: r.dsl.spectrum(4, 2).dsl.difference(path),
    ],
)
@pytest.mark.parametrize("given", ["a.zarr", None])
def test_what_is_no_result_is_told(ask: Callable[[xr.Dataset, Any], Any], given: Any) -> None:
    with pytest.raises(DecodeError, match=r"A result is needed.*of type (str|NoneType)\."):
        ask(small_result(), given)


@pytest.mark.parametrize(
    "ask",
    [
        lambda given: dsl.load_result(given),
        lambda given: dsl.load_scan(given),
        lambda given: dsl.load_calibration(given),
        lambda given: dsl.read_spectra(given),
        lambda given: dsl.reconstruct(given),
        lambda given: dsl.open_rig(given),
        lambda given: dsl.export(small_result(), given),
        lambda given: small_result().dsl.save(given),
        lambda given: dsl.classify(small_result(), [given]),
    ],
)
@pytest.mark.parametrize("given", [5, b"a.zarr", None, {"a": (1, 3)}])
def test_what_is_no_path_is_told(ask: Callable[[Any], Any], given: Any) -> None:
    with pytest.raises(StoreError, match=r"A path is needed.*of type (int|bytes|NoneType|dict)\."):
        ask(given)


def test_the_path_of_a_calibration_is_none() -> None:
    with pytest.raises(CalibrationError, match=r"A calibration is needed.*of type str\."):
        dsl.depth_of_columns("rig.json", np.zeros((2, 2)))  # type: ignore[arg-type]


@pytest.mark.parametrize("pixels", [(4, 2), [4, 2], np.array([[4, 2]]), [(4.0, 2)], [np.array([4, 2])]])
def test_pixels_of_a_table_are_a_list_an_array_or_one(tmp_path: Path, pixels: Any) -> None:
    dsl.export(small_result(), tmp_path / "a.csv", pixels=[(4, 2)])
    dsl.export(small_result(), tmp_path / "b.csv", pixels=pixels)
    assert (tmp_path / "b.csv").read_bytes() == (tmp_path / "a.csv").read_bytes()


@pytest.mark.parametrize(
    "pixels", [5, (4, 2, 1, 1), [(4, 2, 1)], [(1, 2), (3,)], "4,2", [(4.5, 2)], [(float("nan"), 2)], {4: 2}]
)
@pytest.mark.filterwarnings("error")
def test_what_is_no_list_of_pixels_is_told(tmp_path: Path, pixels: Any) -> None:
    with pytest.raises(StoreError, match="A pixel is x, y in whole pixels"):
        dsl.export(small_result(), tmp_path / "a.csv", pixels=pixels)


def test_what_keeps_its_axes_is_answered() -> None:
    result = small_result()
    assert result.isel(y=[3]).dsl.points().sizes["point"] == result.sizes["x"]
    assert result.isel(wavelength_nm=[3]).dsl.spectrum(4, 2).sizes["wavelength_nm"] == 1
    point = result.dsl.points().isel(point=3)
    assert result.dsl.spectrum(point["x"], point["y"]).attrs["name"]


def test_one_spectrum_is_no_result_to_save(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"a.zarr: the dataset has no pixels.*\.csv"):
        small_result().dsl.spectrum(4, 2).dsl.save(tmp_path / "a.zarr")
    assert not (tmp_path / "a.zarr").exists()


@pytest.mark.parametrize(
    "region", [(1.9, 2.9, 10.7, 10.2), (1, 2, float("nan"), 4), ("a", 1, 2, 3), "1,2,3,4", ((1, 2), (3,)), 5]
)
def test_a_region_is_of_whole_pixels(region: Any) -> None:
    with pytest.raises(PlanError, match="A region is x, y, width and height in whole pixels, given"):
        _region(region, (112, 72))
    assert _region(np.array([1.0, 2, 10, 10]), (112, 72)) == (1, 2, 10, 10)  # type: ignore[arg-type]


@pytest.mark.parametrize("bands", [(430, "x", 5), ((1, 2), (3,), 4), "430", (430, None, 5)])
def test_bands_are_numbers(bands: Any) -> None:
    with pytest.raises(PlanError, match="bands_nm"):
        _grid(bands)


def test_a_preset_is_a_plan_by_its_name(tmp_path: Path) -> None:
    with dsl.open_rig("twin", size="16x16") as rig:
        with pytest.raises(PlanError, match="no plan 'best'; choose preview"):
            dsl.scan(rig, tmp_path / "a.dsl", "best")
        with pytest.raises(PlanError, match="no plan 'best'"):
            dsl.predict(rig, "best")
        scan = dsl.scan(rig, tmp_path / "a.dsl", "preview")
        assert scan.plan == dsl.plan(rig, "preview")
        rig.calibration = None
        with pytest.raises(CalibrationError, match="Nothing can be predicted"):
            dsl.predict(rig, "preview")


def test_a_rig_profile_may_be_a_path(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="nope"):
        dsl.open_rig(tmp_path / "nope.json")
    (tmp_path / "lab.json").write_text(json.dumps({"no": "profile"}), encoding="utf-8")
    with pytest.raises(DeviceError, match=r"lab\.json"):
        dsl.open_rig(tmp_path / "lab.json")


@pytest.mark.parametrize("name", ["cuda:99", "abacus", None])
def test_a_device_that_is_not_there_is_told(name: Any) -> None:
    with pytest.raises(PlanError, match=r"no device .* choose cpu, cuda, auto"):
        _device(name)
