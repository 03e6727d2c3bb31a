"""The bandpass calibration on a twin whose truth it does not know."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dsl_core.campaign.bandpass import recipe
from dsl_core.campaign.bandpass.recipe import BandpassRecipe
from dsl_core.campaign.common.recipe import Bench
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.bandpass import BandpassCalibration
from dsl_core.model.figure import failures
from dsl_core.model.placement import Placement
from dsl_core.model.projector.line_spread import LineSpread
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.progress import NoProgress
from tests.cases.film_bench import film_bench, place, take, take_all, truth_of, without

#: Their fixtures calibrate a rig; `tests/campaign/test_kept_figures.py` calibrates one in any run.
pytestmark = pytest.mark.slow

RECIPE = BandpassRecipe(filters_nm=(450.0, 480.0, 540.0, 590.0, 610.0, 640.0), pixels=4000)
INSIDE_NM = np.arange(450.0, 641.0, 10.0)


#: What earlier calibrations found; film and response are known by data sheets.
KNOWN = ("camera", "projector", "pose", "emission", "sensor", "flat_field")


@pytest.fixture(scope="module")
def bench(module_folder: Path) -> Bench:
    """All steps captured on a drawn rig."""
    bench = film_bench(module_folder, 4, KNOWN)
    response = truth_of(bench.devices).projector_response.model_copy(
        update={"blur_px": 0.6, "halo_peak_per_px": 0.0, "halo_decay_px": 30.0}
    )
    return take_all(RECIPE, replace(bench, rig=bench.rig.model_copy(update={"projector_response": response})))


@pytest.fixture(scope="module")
def record(bench: Bench) -> BandpassCalibration:
    return RECIPE.fit(bench, NoProgress())


@pytest.mark.parametrize("order", [1, -1])
def test_efficiency_is_within_half_a_percent_and_its_deviation(
    bench: Bench, record: BandpassCalibration, order: int
) -> None:
    nm = np.array([each.effective_nm for each in record.filters])
    truth = truth_of(bench.devices).efficiency[order]
    curve = record.efficiency[order]
    assert curve.std is not None
    error = curve.at(nm) - truth.at(nm)
    assert np.abs(error / truth.at(nm)).max() < 0.005
    # Between filters as well, deviations hold.
    for at in (nm, INSIDE_NM):
        sigmas = (curve.at(at) - truth.at(at)) / np.interp(at, curve.wavelengths_nm, curve.std)
        assert np.sqrt(np.mean(sigmas**2)) < 2.2


def test_second_order_blur_and_halo_are_found(bench: Bench, record: BandpassCalibration) -> None:
    truth = truth_of(bench.devices)
    share = float(np.mean(truth.efficiency[2].at(INSIDE_NM) / truth.efficiency[1].at(INSIDE_NM)))
    assert record.second_order_share == pytest.approx(share, rel=0.15)
    found = RECIPE.apply(record, bench.rig).projector_response
    assert found.blur_px == pytest.approx(truth.projector_response.blur_px, rel=0.01)
    assert found.halo_peak_per_px == pytest.approx(truth.projector_response.halo_peak_per_px, rel=0.02)
    assert found.halo_decay_px == pytest.approx(truth.projector_response.halo_decay_px, rel=0.03)


def test_a_spread_is_sought_once_the_halo_is_known_and_then_kept(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before, its curve would hold the halo."""
    start, step = bench.rig.projector_response, RECIPE.steps(bench)[0]
    halo = start.model_copy(update={"blur_px": 0.8, "halo_peak_per_px": 0.002})
    curve = halo.with_spread(LineSpread(first_px=0.0, step_px=0.5, core_px=0.7, shares=(1.0,)))
    refined = curve.of_width(0.71)
    seen, fitted = list[ProjectorResponse](), list[ProjectorResponse]()

    def lines(source: object, rig: Rig, *given: object) -> tuple[Rig, object]:
        seen.append(rig.projector_response)
        shown = curve if rig.projector_response == halo else rig.projector_response
        return rig.model_copy(update={"projector_response": shown}), "lines"

    def profile(rig: Rig, *given: object) -> SimpleNamespace:
        fitted.append(rig.projector_response)
        return SimpleNamespace(response=halo if rig.projector_response == start else refined)

    monkeypatch.setattr(recipe, "diffuser_lines", lines)
    monkeypatch.setattr(recipe, "plane_profile", profile)
    assert RECIPE._plane(bench, step, NoProgress())[1].response == refined
    assert (seen, fitted) == ([start, halo], [start, curve])


def test_response_comes_near_the_truth(bench: Bench, record: BandpassCalibration) -> None:
    truth, before, after = truth_of(bench.devices), bench.rig, RECIPE.apply(record, bench.rig)
    nm = np.array([each.effective_nm for each in record.filters])
    for colour in range(3):
        true = truth.white_scale * truth.response[colour].at(nm)
        bright = true > 0.3 * true.max()
        errors = [
            (rig.white_scale * rig.response[colour].at(nm) / true - 1)[bright] for rig in (before, after)
        ]
        assert np.abs(errors[1]).max() < 0.03
        assert np.sqrt(np.mean(errors[1] ** 2)) < 0.5 * np.sqrt(np.mean(errors[0] ** 2))


@pytest.mark.parametrize(
    ("off_nm", "std_nm", "passes"),
    [(0.9, 0.1, True), (-6.0, 0.1, False), (1.2, 0.1, False), (2.0, 0.8, True)],
)
def test_filters_that_are_all_off_alike_are_refused(
    record: BandpassCalibration, off_nm: float, std_nm: float, passes: bool
) -> None:
    off = record.model_copy(update={"filters_off_nm": off_nm, "filters_off_std_nm": std_nm})
    refused = [f for f in failures(RECIPE.figures(off)) if "LEDs" in f.name]
    assert passes == (not refused)
    if refused:
        assert f"{off_nm:.2f} ± {std_nm:.2f} nm" in str(refused[0])
        assert "spectroradiometer" in refused[0].advice


def test_the_index_of_filters_is_told_where_they_shift(record: BandpassCalibration) -> None:
    assert record.filter_index is None, "the twin's own filters do not shift"
    shifting = record.model_copy(update={"filter_index": (1.9, 0.05)})
    (told,) = [f for f in RECIPE.figures(shifting) if f.name.startswith("refractive index of the filters")]
    assert (told.value, told.std, told.passed) == (1.9, 0.05, True)
    assert not [f for f in RECIPE.figures(record) if f.name.startswith("refractive index of the filters")]


def test_figures_pass_and_record_goes_through_json(record: BandpassCalibration) -> None:
    assert failures(RECIPE.figures(record)) == ()
    assert BandpassCalibration.model_validate_json(record.model_dump_json()) == record


def test_a_target_darker_than_stated_is_refused_as_no_clear_film_takes_so_much(
    bench: Bench, record: BandpassCalibration
) -> None:
    assert record.passed is not None
    in_orders = sum(float(curve.at(550.0)) for curve in record.efficiency.values())
    assert record.passed == pytest.approx(record.white_scale / bench.rig.white_scale * (1 + in_orders))
    (told,) = failures(RECIPE.figures(record.model_copy(update={"passed": 0.69})))
    assert told.advice.startswith("The target is darker than the Spectralon")
    for sound in (0.71, 1.3, None):
        assert failures(RECIPE.figures(record.model_copy(update={"passed": sound}))) == ()


@pytest.mark.parametrize(
    ("measured", "done", "advised", "not_advised"),
    [
        (False, (), "Measure the filters' transmissions, or calibrate with a Color Checker", "long_ratio"),
        (True, ("geometry",), "Calibrate with a Color Checker first.", "ransmissions"),
        (True, ("color-checker",), "Use more filters .*long_ratio", "with a Color Checker|ransmissions"),
    ],
)
def test_advice_names_nothing_that_was_done_already(
    record: BandpassCalibration, measured: bool, done: tuple[str, ...], advised: str, not_advised: str
) -> None:
    filters = tuple(each.model_copy(update={"curve_measured": measured}) for each in record.filters)
    figures = RECIPE.figures(record.model_copy(update={"filters": filters}), done)
    (advice,) = {figure.advice for figure in figures if figure.name.startswith("response of")}
    assert re.search(advised, advice)
    assert not re.search(not_advised, advice)


def test_finished_scan_is_not_taken_again(bench: Bench) -> None:
    step = RECIPE.steps(bench)[1]
    before = bench.scan_of(step).entries
    take(RECIPE, bench, step)
    assert bench.scan_of(step).entries == before


def test_wrong_filter_is_refused_before_anything_is_stored(bench: Bench, tmp_path: Path) -> None:
    other = Bench(bench.devices, tmp_path, bench.rig)
    step = RECIPE.steps(other)[1]
    place(other, step.placement.model_copy(update={"filter_nm": 600.0}))
    looked = {figure.name: figure for figure in RECIPE.look(other, step)}
    assert not looked["filter by its colours"].passed
    with pytest.raises(
        CalibrationError, match=r"Filter of 450 nm: the colours are those of a filter of about"
    ):
        RECIPE.capture(other, step, NoProgress())
    assert not RECIPE.is_captured(other, step)


def test_missing_filter_is_refused(bench: Bench) -> None:
    recipe = BandpassRecipe(filters_nm=(*RECIPE.filters_nm, 520.0))
    step = next(step for step in recipe.steps(bench) if step.placement.filter_nm == 520.0)
    place(bench, step.placement.model_copy(update={"filter_nm": None}))
    with pytest.raises(CalibrationError, match="about as bright as without a filter"):
        recipe.capture(bench, step, NoProgress())


def test_neighbouring_filter_is_found_by_the_places_of_its_orders(bench: Bench, tmp_path: Path) -> None:
    # So near that colours do not tell: 550 where 540 was asked for.
    step = next(step for step in RECIPE.steps(bench) if step.placement.filter_nm == 540.0)
    other = without(bench, tmp_path, step)
    take(RECIPE, other, step, filter_nm=550.0)
    with pytest.raises(
        CalibrationError, match=r"filter of 540 nm: its first orders are where those of 5\d\d ± \d+ nm"
    ):
        RECIPE.fit(other, NoProgress())


def test_dark_beam_is_refused(bench: Bench, tmp_path: Path) -> None:
    other = Bench(bench.devices, tmp_path, bench.rig)
    step = RECIPE.steps(other)[0]
    place(other, Placement(target="nothing", film=True))
    with pytest.raises(CalibrationError, match="White target without filter is too dark"):
        RECIPE.capture(other, step, NoProgress())


def test_one_filter_is_too_few(bench: Bench) -> None:
    with pytest.raises(CalibrationError, match="at least two different filters"):
        BandpassRecipe(filters_nm=(500.0, 500.0)).steps(bench)
