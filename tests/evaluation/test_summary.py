"""Figures of a whole result, and their verdicts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dsl_core.errors import DecodeError, StoreError
from dsl_core.evaluation.report.scan_report import _patch_note, render_report, report_content
from dsl_core.evaluation.summary import Evaluation, Truth, evaluate, interior
from dsl_core.evaluation.time_sweep import point_against_truth
from dsl_core.evaluation.verdict import Goal, deviations, figures, verdicts


def test_depth_is_judged_over_lit_pixels(known: Any) -> None:
    depth = evaluate(known.result, known.truth).depth
    assert depth is not None
    assert depth.coverage == 1.0
    assert depth.pixels == 36 * 70
    assert depth.bias_mm == pytest.approx(0.25, abs=0.03)
    assert depth.rmse_mm == pytest.approx(np.hypot(0.25, 0.5), rel=0.05)


def test_patches_have_the_errors_that_were_put_in(known: Any) -> None:
    ramp, narrow = evaluate(known.result, known.truth).patches
    assert (ramp.name, narrow.name) == ("ramp", "filter")
    # The first four rows hold nothing, three pixels at each border are mixed.
    assert ramp.pixels == (40 - 4 - 3) * (40 - 3)
    # Shadowed pixels are not wanted, so that their absence costs no coverage.
    assert ramp.coverage == narrow.coverage == 1.0
    assert ramp.scale == pytest.approx(1 / 0.9, rel=1e-3)
    assert ramp.rmse == pytest.approx(0.1 * np.sqrt(np.mean(ramp.truth**2)), rel=0.01)
    assert ramp.rmse_scaled < 0.001
    assert ramp.pixel_rmse == pytest.approx(np.hypot(ramp.rmse, 0.01), rel=0.01)
    assert ramp.delta_e > 2 > ramp.delta_e_scaled
    assert ramp.peak is None
    assert narrow.truth_peak is not None
    assert narrow.peak is not None
    assert narrow.peak.fwhm_nm == pytest.approx(narrow.truth_peak.fwhm_nm, abs=0.1)


def test_single_pixels_have_one_rmse_wherever_it_is_told(known: Any) -> None:
    found = evaluate(known.result, known.truth)
    one, other = (patch.pixel_rmse for patch in found.patches)
    assert other > 1.5 * one
    told = figures(found)["spectral_pixel_rmse"], deviations(found)["spectral_pixel_rmse"]
    assert told[0] == pytest.approx(np.sqrt((one**2 + other**2) / 2))
    swept = point_against_truth("scan", 1.0, found)
    assert (swept.reflectance, swept.reflectance_std) == told


def test_calibration_counts_only_bands_that_data_decide(known: Any) -> None:
    only_filter = replace(known.truth, targets=(1,))
    decided = evaluate(known.result, only_filter).spectral_calibration
    assert decided is not None
    assert decided.coverage_95 == pytest.approx(0.95, abs=0.01)
    assert decided.share == pytest.approx(42 / 47)
    everything = evaluate(known.result.drop_vars("data_share"), only_filter).spectral_calibration
    assert everything is not None
    assert everything.coverage_95 == pytest.approx(0.95 * 42 / 47, abs=0.01)


def test_uncertainties_that_nothing_can_be_held_against_leave_the_rest_judged(known: Any) -> None:
    known.result["data_share"].values[:] = 0.0
    known.result["depth_std_mm"].values[:] = np.nan
    found = evaluate(known.result, known.truth)
    assert (found.depth_calibration, found.spectral_calibration) == (None, None)
    assert found.depth is not None
    assert len(found.patches) == 2


def test_targets_choose_the_materials(known: Any) -> None:
    assert [p.name for p in evaluate(known.result, replace(known.truth, targets=(0,))).patches] == ["ramp"]


def test_a_material_without_measurement_is_named(known: Any) -> None:
    known.result["reflectance"].values[:, :, 40:] = np.nan
    evaluation = evaluate(known.result, known.truth)
    assert evaluation.unmeasured == ("filter",)
    assert [patch.name for patch in evaluation.patches] == ["ramp"]


def test_coverage_counts_missing_pixels(known: Any) -> None:
    known.result["reflectance"].values[3, 20:, :40] = np.nan
    ramp = evaluate(known.result, known.truth).patches[0]
    assert ramp.coverage == pytest.approx((20 - 4 - 3) / (40 - 4 - 3))


def test_depth_only_result_has_only_depth(known: Any) -> None:
    evaluation = evaluate(known.result[["depth_mm"]], known.truth)
    assert evaluation.depth is not None
    assert evaluation.depth_calibration is None
    assert evaluation.patches == ()
    with pytest.raises(DecodeError, match="no patch"):
        evaluation.mean("rmse")


def test_nothing_known_nothing_said(known: Any) -> None:
    assert evaluate(known.result, Truth()) == Evaluation(None, None, (), (), None)


def test_truth_of_another_size_is_refused(known: Any) -> None:
    wrong = replace(known.truth, depth_mm=None, material=known.truth.material[:, :-1])
    with pytest.raises(DecodeError, match="render the truth"):
        evaluate(known.result, wrong)


def test_interior_leaves_out_borders() -> None:
    material = np.zeros((20, 20), np.int32)
    material[:, 10:] = 1
    inside = interior(material, 2)
    np.testing.assert_array_equal(np.flatnonzero(~inside[5]), [8, 9, 10, 11])


def test_verdicts_follow_their_goals(known: Any) -> None:
    evaluation = evaluate(known.result, known.truth)
    goals = {
        "depth_rmse_mm": Goal(1.0),
        "depth_coverage": Goal(0.99, at_least=True),
        "spectral_rmse": Goal(0.015),
        "fwhm_nm": Goal(13.0),
    }
    rows = {row.figure: row for row in verdicts(evaluation, goals)}
    assert rows["Depth, RMSE per pixel"].passed is True
    assert rows["Lit pixels with a depth"].value == "100.00"
    assert rows["Lit pixels with a depth"].wanted == "≥ 99"
    assert rows["Reflectance, mean RMSE of patches"].passed is False
    assert rows["Mean width of narrow peaks"].passed is True
    assert rows["Depth, bias"].passed is None
    assert len(rows) == len(figures(evaluation)) == 13


def test_estimates_have_a_deviation_and_counts_have_none(known: Any) -> None:
    evaluation = evaluate(known.result, known.truth)
    rows = {row.figure: row for row in verdicts(evaluation)}
    angles = [patch.angle_rad for patch in evaluation.patches]
    expected = np.std(angles, ddof=1) / np.sqrt(len(angles))
    assert float(rows["Mean spectral angle"].std) == pytest.approx(expected, abs=1e-4)
    assert {figure for figure, row in rows.items() if row.std} >= {"Depth, RMSE per pixel", "Depth, bias"}
    for figure in ("Lit pixels with a depth", "Reflectance, worst patch"):
        assert rows[figure].words == rows[figure].value


def test_a_goal_for_an_unknown_figure_is_refused(known: Any) -> None:
    with pytest.raises(KeyError):
        verdicts(evaluate(known.result, known.truth), {"beauty": Goal(1.0)})


def test_bands_that_hold_too_little_of_a_colour_have_no_colour_difference(known: Any) -> None:
    nm = known.result["wavelength_nm"].values
    some = np.flatnonzero((nm >= 440) & (nm <= 460))
    result = known.result.isel(wavelength_nm=some)
    truth = replace(known.truth, targets=(0,), spectra=known.truth.spectra[:, some])
    found = evaluate(result, truth)
    assert np.isnan(found.patches[0].delta_e)
    whole = evaluate(known.result, replace(truth, spectra=known.truth.spectra))
    assert figures(found).keys() == figures(whole).keys() - {"delta_e"}
    assert "delta_e" not in deviations(found)
    assert not any("CIEDE2000" in row.figure for row in verdicts(found))
    assert _patch_note(found.patches[0]) == f"RMSE {found.patches[0].rmse:.3f}"


def test_spectra_without_wavelengths_of_their_own_are_not_judged(known: Any) -> None:
    same = known.result.assign_coords(wavelength_nm=np.full(known.result.sizes["wavelength_nm"], 500.0))
    for result in (same, same.drop_vars("wavelength_nm")):
        with pytest.raises(StoreError, match="not one wavelength for each of its bands"):
            evaluate(result, known.truth)


def test_a_band_that_no_pixel_has_leaves_the_others_judged(known: Any) -> None:
    cube, nm = known.result["reflectance"], known.result["wavelength_nm"]
    masked = known.result.assign(reflectance=cube.where(nm != nm[20]))
    found, whole = evaluate(masked, known.truth), evaluate(known.result, known.truth)
    assert found.patches[0].mean.size == nm.size - 1
    assert found.mean("rmse") == pytest.approx(whole.mean("rmse"), rel=0.1)
    page = render_report(report_content("masked", masked, known.truth, found))
    assert "ramp" in page
    # Other bands of other pixels: each lacks one.
    rows, columns = np.indices(cube.shape[1:])
    chequered = (rows + columns + np.arange(nm.size)[:, None, None]) % 2 == 0
    holes = known.result.assign(reflectance=cube.where(chequered))
    with pytest.raises(DecodeError, match="No pixel of ramp, filter has all bands"):
        evaluate(holes, known.truth).mean("rmse")


def test_a_filter_that_is_measured_without_any_peak_has_no_width_and_all_other_figures(known: Any) -> None:
    dark = known.result.copy(deep=True)
    narrow = known.truth.material == 1
    dark["reflectance"] = dark["reflectance"].where(~narrow, 0.0)
    ramp, flat = evaluate(dark, known.truth).patches
    assert flat.truth_peak is not None
    assert flat.peak is None
    assert ramp.rmse == evaluate(known.result, known.truth).patches[0].rmse
