"""The functions and the accessor that scripts use, from a rig to a plot."""

import importlib.util
import re
from contextlib import chdir
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import dsl_core as dsl
from dsl_core import pipeline
from dsl_core.cli.output import Output
from dsl_core.cli.results import print_figures
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, Cancelled, DecodeError, PlanError, StoreError
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import PRESETS
from dsl_core.resources import resource_path


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the names on the help page stand for after its code has run as it is printed there."""
    text = resource_path("help/scripting.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    with chdir(tmp_path_factory.mktemp("page")):
        for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
            exec(block, names)
        names["folder"] = Path.cwd()
    return names


@pytest.fixture(scope="module")
def scan(page: dict[str, Any]) -> ScanReader:
    found: ScanReader = page["scan"]
    return ScanReader(page["folder"] / found.folder)


@pytest.fixture(scope="module")
def result(page: dict[str, Any]) -> xr.Dataset:
    found: xr.Dataset = page["result"]
    return found


def test_the_help_page_runs_as_written(page: dict[str, Any]) -> None:
    assert (page["folder"] / "spectrum.png").stat().st_size > 0
    assert (page["folder"] / "first.ply").stat().st_size > 0
    assert page["patch"].attrs["used"] == 30
    assert page["fine"].sizes["wavelength_nm"] == 81
    assert page["xyz"].shape == (page["points"].sizes["point"], 3)


def test_every_public_name_is_there_and_documented() -> None:
    assert set(dsl.__all__) <= set(dir(dsl))
    assert all(getattr(dsl, name).__doc__ for name in dsl.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = dsl.nonsense
    assert "twin" in dsl.rigs()


def test_a_finished_scan_is_not_captured_again(scan: ScanReader) -> None:
    before = scan.manifest
    with dsl.open_rig("twin", size="112x72", scene="color-checker") as rig:
        again = dsl.scan(rig, scan.folder, dsl.plan(rig, "quick"))
    assert again.manifest == before
    assert not dsl.load_scan(str(scan.folder)).missing()


def test_a_scan_of_another_scene_is_not_handed_out_as_the_new_one(scan: ScanReader) -> None:
    words = r"scene is color-checker in the scan and sphere now; .* seed is 0 in the scan and 3 now"
    with dsl.open_rig("twin", size="112x72", scene="sphere", seed=3) as rig:
        plan = dsl.plan(rig, "quick")
        with pytest.raises(StoreError, match=words):
            dsl.scan(rig, scan.folder, plan)


def test_a_scan_without_a_plan_is_the_reference_as_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def captured(rig: DeviceRig, plan: CapturePlan, *_: object) -> None:
        raise Cancelled(f"{plan.name}, {plan.shot_count} frames")

    monkeypatch.setattr(pipeline, "scan", captured)
    with dsl.open_rig("twin") as rig:
        with pytest.raises(Cancelled, match="reference, 748 frames"):
            dsl.scan(rig, tmp_path / "a.dsl")
        with pytest.raises(Cancelled, match="reference, 748 frames"):
            dsl.scan(rig, tmp_path / "a.dsl", plan=None)


def test_plans_by_name_and_with_changes() -> None:
    with dsl.open_rig("twin", size="112x72") as rig:
        assert dsl.plan(rig, "balanced", code_settings=(0,)).name == "custom plan"
        changed = dsl.plan(rig, "balanced", name="mine")
        assert changed.name == "mine"
        assert changed.camera_size_px == (112, 72)
        with pytest.raises(PlanError, match=r"no plan 'best'; choose preview, comb, .*reference"):
            dsl.plan(rig, "best")


def test_a_spectrum_has_its_deviation_and_reasons(result: xr.Dataset) -> None:
    y, x = (int(axis[0]) for axis in np.nonzero(result.dsl.good.values))
    found = result.dsl.spectrum(x, y)
    assert found["reflectance"].dtype == np.float32
    np.testing.assert_array_equal(found["reflectance"], result["reflectance"].values[:, y, x])
    assert (found["reflectance_std"] > 0).all()
    assert found.attrs["reasons"] == []
    y, x = (int(axis[0]) for axis in np.nonzero(result["flags"].values))
    assert result.dsl.reasons(x, y)
    with pytest.raises(DecodeError, match="x 112, y 0 is not in the result"):
        result.dsl.spectrum(112, 0)


def test_the_mean_of_a_region(result: xr.Dataset) -> None:
    mask = np.zeros((72, 112), bool)
    mask[20:24, 30:36] = True
    by_mask, by_box = result.dsl.region(mask), result.dsl.region((30, 20, 6, 4))
    xr.testing.assert_equal(by_mask, by_box)
    inside = result["reflectance"].values[:, 20:24, 30:36].reshape(47, -1)
    np.testing.assert_allclose(by_mask["reflectance"], np.nanmean(inside, 1), rtol=1e-6)
    with pytest.raises(DecodeError, match="None of the 0 pixels"):
        result.dsl.region(np.zeros((72, 112), bool))
    with pytest.raises(DecodeError, match="mask has shape"):
        result.dsl.region(np.zeros((2, 2), bool))


def test_a_region_says_its_units_and_takes_whole_pixels_alone(result: xr.Dataset) -> None:
    patch = result.dsl.region((30, 20, 6, 4))
    assert all(patch[name].attrs["units"] == "1" for name in patch)
    with pytest.raises(DecodeError, match="in whole pixels"):
        result.dsl.region((30.5, 20, 6, 4))
    with pytest.raises(DecodeError, match="call spectrum"):
        result.dsl.region((30, 20))
    with pytest.raises(DecodeError, match=r"outside the result \(x 0 to 111, y 0 to 71\)"):
        result.dsl.region((112, 20, 6, 4))


def test_spectra_of_two_scans_may_differ_by_their_scales(result: xr.Dataset) -> None:
    again = result.assign_attrs(captured="2026-01-02T10:00:00+00:00", reflectance_scale_rel_std=0.03)
    for one, other in (
        (result.dsl.region((48, 28, 6, 5)), again.dsl.region((48, 28, 6, 5))),
        (result.dsl.spectrum(50, 30), again.dsl.spectrum(50, 30)),
    ):
        brighter = other.assign(reflectance=1.03 * other["reflectance"])
        less = one.dsl.difference(brighter)
        wanted = np.sqrt(
            one["reflectance_std"] ** 2
            + other["reflectance_std"] ** 2
            + (one.attrs["reflectance_scale_rel_std"] * one["reflectance"]) ** 2
            + (0.03 * brighter["reflectance"]) ** 2
        )
        np.testing.assert_allclose(less["reflectance_std"], wanted, rtol=1e-6)
        assert not less.attrs["differ"]


def test_two_spectra_differ_where_their_deviations_do_not_explain_it(result: xr.Dataset) -> None:
    one, other = result.dsl.region((48, 28, 6, 5)), result.dsl.region((60, 28, 6, 5))
    less = one.dsl.difference(other)
    np.testing.assert_allclose(less["reflectance"], one["reflectance"] - other["reflectance"])
    np.testing.assert_allclose(less["reflectance_std"], np.hypot(one.reflectance_std, other.reflectance_std))
    sigmas = np.abs(less["reflectance"] / less["reflectance_std"])
    assert less.attrs["most_sigmas"] == pytest.approx(float(sigmas.max()))
    assert less.attrs["most_nm"] == float(sigmas.idxmax())
    assert less.attrs["differ"] == (less.attrs["most_sigmas"] > 4)
    assert not one.dsl.difference(one).attrs["differ"]
    few = one.dsl.difference(other.isel(wavelength_nm=slice(0, 5)))
    assert few.sizes["wavelength_nm"] == 5
    assert len(less.dsl.plot(ax=plt.figure().subplots()).lines) == 1
    with pytest.raises(DecodeError, match="of two spectra"):
        result.dsl.difference(one)
    with pytest.raises(DecodeError, match="no band"):
        one.dsl.difference(other.assign_coords(wavelength_nm=other["wavelength_nm"] + 1))


@pytest.mark.slow
def test_what_a_plan_will_reach_is_predicted_without_a_capture() -> None:
    with dsl.open_rig("twin", size="112x72") as rig:
        plan = dsl.plan(rig, "preview")
        expected = dsl.predict(rig, plan)
        assert dsl.predict(replace(rig, calibration=None), plan, rig.calibration) == expected
        with pytest.raises(CalibrationError, match="has no calibration"):
            dsl.predict(replace(rig, calibration=None), plan)
    assert expected.seconds == pytest.approx(plan.duration_s(rig.projector.info.latency_ms), abs=1e-3)
    assert 0 < expected.rmse < expected.pixel_rmse < 1


def test_the_help_on_plans_names_every_preset() -> None:
    assert all(re.search(rf"\b{each.key}\b", dsl.plan.__doc__ or "") for each in PRESETS)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"bands_nm": (650, 450, 10)}, "450 nm, must be above the first, 650 nm"),
        ({"bands_nm": 5}, "given 5"),
        ({"device": "abacus"}, "no device 'abacus'; choose cpu, cuda, auto"),
    ],
)
def test_what_a_reconstruction_cannot_do_is_said_in_words(
    scan: ScanReader, wrong: dict[str, Any], words: str
) -> None:
    with pytest.raises(PlanError, match=words):
        dsl.reconstruct(scan, **wrong)


def test_a_scan_shows_where_it_is_and_how_much_of_it(scan: ScanReader) -> None:
    assert repr(scan) == f"ScanReader({str(scan.folder)!r}: 154 of 154 frames)"


def test_points_are_the_pixels_with_depth(result: xr.Dataset) -> None:
    points = result.dsl.points()
    known = np.isfinite(result["depth_mm"].values)
    assert points.sizes["point"] == known.sum()
    first = points.isel(point=0)
    assert result["depth_mm"].sel(x=int(first["x"]), y=int(first["y"])) == first["depth_mm"]


def test_a_plot_shows_the_band(result: xr.Dataset) -> None:
    y, x = (int(axis[0]) for axis in np.nonzero(result.dsl.good.values))
    axes = result.dsl.spectrum(x, y).dsl.plot(ax=plt.figure().subplots())
    (line,), (band,) = axes.lines, axes.collections
    np.testing.assert_allclose(line.get_ydata(), result["reflectance"].values[:, y, x])
    height = np.ptp(band.get_paths()[0].vertices[:, 1])
    assert height > np.ptp(line.get_ydata())
    assert axes.get_xlabel() == "wavelength (nm)"
    with pytest.raises(DecodeError, match="Say which pixel"):
        result.dsl.plot()


@pytest.mark.slow
def test_part_of_a_picture_is_solved_again_with_other_bands(scan: ScanReader, result: xr.Dataset) -> None:
    again = dsl.reconstruct(scan, region_px=(24, 18, 12, 8))
    part = result.sel(x=slice(24, 35), y=slice(18, 25))
    for name in ("depth_mm", "reflectance", "reflectance_std", "flags"):
        np.testing.assert_array_equal(again[name], part[name])
    np.testing.assert_array_equal(again["x"], part["x"])
    coarse = dsl.reconstruct(scan, region_px=(24, 18, 12, 8), bands_nm=(450, 650, 10))
    assert coarse["wavelength_nm"].values.tolist() == list(range(450, 651, 10))
    # Arithmetic goes by coordinates: bands and pixels that both have.
    assert float(abs(coarse["reflectance"] - part["reflectance"]).median()) < 0.02
    with pytest.raises(PlanError, match="not a part of the picture of 112 x 72"):
        dsl.reconstruct(scan, region_px=(104, 0, 12, 8))


def test_results_go_to_disk_and_to_other_readers(result: xr.Dataset, tmp_path: Path) -> None:
    path = result.dsl.save(tmp_path / "made.zarr")
    loaded = dsl.load_result(str(path))
    assert loaded["reflectance"].dtype == np.float32
    assert loaded.dsl.verdict == result.dsl.verdict != ""
    # A warning is an error here: metadata are where xarray looks for them.
    foreign = xr.open_zarr(path)
    np.testing.assert_array_equal(foreign["x"], np.arange(112))
    np.testing.assert_array_equal(foreign["wavelength_nm"], result["wavelength_nm"])
    np.testing.assert_allclose(foreign["reflectance"], result["reflectance"], atol=3e-5)
    assert dsl.export(loaded, tmp_path / "cloud.ply") == [tmp_path / "cloud.ply"]
    with pytest.raises(StoreError, match="no ending that says its format"):
        dsl.export(loaded, tmp_path / "cloud")


def test_the_readme_shows_what_evaluate_prints(
    result: xr.Dataset, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its commands make the same scan as the page on scripts; every line, with figures within a tolerance."""
    folder = Path(__file__).resolve().parents[2]
    spec = importlib.util.spec_from_file_location("outputs", folder / "packaging" / "outputs.py")
    assert spec is not None
    assert spec.loader is not None
    outputs = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(outputs)
    shown = outputs.shown((folder / "README.md").read_text(encoding="utf-8"))
    assert set(shown) == set(outputs.BEFORE)
    print_figures(Output(False), dsl.evaluate(result))
    printed = capsys.readouterr().out.splitlines()
    lines = shown["dsl-scan evaluate small.zarr"]
    assert outputs.differences(lines, printed) == []
    assert len(lines) == len(printed)
    # A changed figure, a missing line and one too many are told.
    assert len(outputs.differences([lines[0], lines[1].replace("1.4", "1.7"), *lines[2:]], printed)) == 1
    assert outputs.differences([*lines[:2], *lines[3:]], printed)
    assert outputs.differences([*lines, "Speckle 0.1 %"], printed) == [
        "shown: Speckle 0.1 %; printed: nothing"
    ]


def test_a_twins_result_is_compared_with_its_truth(result: xr.Dataset) -> None:
    found = dsl.evaluate(result)
    assert found.depth_calibration is not None
    assert found.depth_calibration.coverage_95 > 0.9


def test_spectra_become_tables_that_are_read_again(
    page: dict[str, Any], result: xr.Dataset, tmp_path: Path
) -> None:
    part = result.sel(x=slice(44, 55), y=slice(26, 33))
    dsl.export(part, tmp_path / "pixels.csv", pixels=[(46, 28), (50, 30)])
    found = dsl.read_spectra(tmp_path / "pixels.csv")
    assert list(found) == ["x 46, y 28", "x 50, y 30"]
    expected = result["reflectance"].sel(x=46, y=28).values
    # As many digits as the deviation knows.
    known = result["reflectance_std"].sel(x=46, y=28).values / 100
    assert (np.abs(found["x 46, y 28"] - expected) <= known).all()
    with pytest.raises(StoreError, match=r"No such pixel: \(3, 4\).*x runs from 44 to 55"):
        dsl.export(part, tmp_path / "other.csv", pixels=[(3, 4)])
    with pytest.raises(StoreError, match="Pixels are for csv, not for ply"):
        dsl.export(part, tmp_path / "a.ply", pixels=[(46, 28)])
    one = result.dsl.spectrum(50, 30)
    (path,) = dsl.export(one, tmp_path / "one.csv")
    off = np.abs(dsl.read_spectra(path)["x 50, y 30"] - one["reflectance"])
    assert (off <= one["reflectance_std"] / 100).all()
    with pytest.raises(StoreError, match="A spectrum is exported as csv, not as ply"):
        dsl.export(one, tmp_path / "one.ply")
    assert float(abs(page["off"]).max()) < 5e-5


def test_what_is_not_in_a_result_is_told(result: xr.Dataset, scan: ScanReader) -> None:
    with pytest.raises(DecodeError, match="x 999, y 1 is not in the result"):
        result.dsl.reasons(999, 1)
    with pytest.raises(DecodeError, match=r"x 900, y 900, .* is outside the result \(x 0 to 111"):
        result.dsl.region((900, 900, 5, 5))
    with pytest.raises(DecodeError, match="one spectrum, not a result"):
        result.dsl.spectrum(50, 30).dsl.spectrum(50, 30)
    with pytest.raises(PlanError, match=r"bands_nm are .* given 11 values"):
        dsl.reconstruct(scan, bands_nm=np.arange(450, 651, 20))  # type: ignore[arg-type]
    with pytest.raises(
        PlanError, match=r"A region is x, y, width and height in whole pixels, given \(72, 112\) values"
    ):
        dsl.reconstruct(scan, region_px=np.ones((72, 112), bool))  # type: ignore[arg-type]
    with pytest.raises(StoreError, match="The library has no calibration 'nobody'"):
        dsl.reconstruct(scan, "nobody")
    with pytest.raises(DecodeError, match="Give a library of spectra, pins, or both"):
        dsl.classify(result)
    assert dsl.colours(result, {"a": (50, 30)}, "D65").sizes["light"] == 1


def test_options_may_be_sizes_and_wrong_fields_of_plans_are_told() -> None:
    assert {"scan", "read_spectra"} <= set(dir(dsl))
    assert "import_module" not in dir(dsl)
    with dsl.open_rig("twin", size=np.array([112.0, 72.0]), noise=np.bool_(False)) as rig:
        assert dsl.plan(rig, "quick").camera_size_px == (112, 72)
    with dsl.open_rig("twin", size=(112, 72)) as rig:
        assert dsl.plan(rig, "quick").camera_size_px == (112, 72)
        with pytest.raises(PlanError, match=r"exposure_ms .* Its fields are schema_version, name"):
            dsl.plan(rig, "quick", exposure_ms=3)
