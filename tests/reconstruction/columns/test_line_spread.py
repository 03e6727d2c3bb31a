"""A scan whose projector is not in the focus of its calibration, and waves in a part of the picture."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import torch

from dsl_core import pipeline
from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines
from dsl_core.model.projector.spread_field import SpreadField
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction.columns.line_spread import own_spread, scene_spread, wave_std_px
from dsl_core.reconstruction.merge import MergedScan, decode_columns, stack_lines
from dsl_core.workflows import truths
from tests.cases.line_peaks import RUN, seen
from tests.cases.twin_scan import MemoryScan, twin_scan

Scanned = tuple[Rig, MemoryScan, np.ndarray]


@pytest.fixture(scope="module")
def scanned() -> Scanned:
    """A chart, and its true depth."""
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=3))
    devices, scan = twin_scan(plan, size="160x104", scene="color-checker")
    truth = truths.twin_truth(devices, pipeline.Options().grid)
    assert devices.calibration is not None
    assert truth is not None
    assert truth.depth_mm is not None
    return devices.calibration, scan, truth.depth_mm


def blurred(rig: Rig, blur_px: float) -> Rig:
    response = rig.projector_response.with_gaussian(blur_px)
    return rig.model_copy(update={"projector_response": response})


def depth_error_mm(scanned: Scanned, rig: Rig, as_calibrated: bool) -> tuple[float, Fit]:
    _, scan, truth = scanned
    options = pipeline.Options(spectra=False, as_calibrated=as_calibrated)
    result = pipeline.reconstruct(scan, rig, options)
    fit = Fit.read(result.attrs)
    assert fit is not None
    return float(np.sqrt(np.nanmean((result["depth_mm"].values - truth) ** 2))), fit


@pytest.fixture(scope="module")
def right(scanned: Scanned) -> float:
    """Error of depth (mm) with the right calibration, which nothing is said against."""
    error, fit = depth_error_mm(scanned, scanned[0], as_calibrated=False)
    assert "line spread" not in {finding.name for finding in fit.significant}
    assert "line spread over the field" not in {finding.name for finding in fit.findings}
    return error


@pytest.mark.slow
def test_a_wrong_blur_of_the_calibration_does_no_harm_and_is_told(scanned: Scanned, right: float) -> None:
    wrong = blurred(scanned[0], 0.7)
    before, fit = depth_error_mm(scanned, wrong, as_calibrated=True)
    assert "line spread" not in {finding.name for finding in fit.findings}
    after, fit = depth_error_mm(scanned, wrong, as_calibrated=False)
    assert before > 3 * right
    assert after < 1.05 * right
    told = next(finding for finding in fit.significant if finding.name == "line spread")
    assert told.part == "profile"
    assert re.search(r"over 0\.(599|600) ± 0\.00\d px", told.sentence)
    assert "by the projector's calibration over 0.700 px" in told.sentence


@pytest.mark.slow
def test_a_field_that_the_calibration_has_wrong_does_no_harm(scanned: Scanned, right: float) -> None:
    """Columns follow the field that is stated, and the scan states its own."""
    field = SpreadField(
        centre_px=(320.0, 180.0), half_px=(320.0, 180.0), coefficients=(0.0, 0.1, 0.1, 0.1, 0.0, 0.1)
    )
    response = scanned[0].projector_response.model_copy(update={"field": field})
    wrong = scanned[0].model_copy(update={"projector_response": response})
    assert depth_error_mm(scanned, wrong, as_calibrated=True)[0] > 2 * right
    assert depth_error_mm(scanned, wrong, as_calibrated=False)[0] < 1.05 * right


def test_only_single_lines_without_gaps_show_the_spread(scanned: Scanned) -> None:
    rig, scan, _ = scanned
    merged = MergedScan(scan, rig)
    code, white = decode_columns(merged)
    stack = stack_lines(merged)
    lines = LineSet.of(scan.plan)
    assert own_spread(rig, lines, code, white, stack) is not None
    assert own_spread(rig, None, code, white, stack) is None
    comb = LineSet.of(CapturePlan(spectral=LineComb(shifts_px=(0, 0, 0))))
    assert own_spread(rig, comb, code, white, stack) is None
    sparse = LineSet.of(CapturePlan(spectral=ScanLines(width_px=5, step_px=8, sparse=True)))
    assert own_spread(rig, sparse, code, white, stack) is None


LINES = LineSet.of(CapturePlan(spectral=ScanLines(width_px=5, step_px=2)))


#: Deviations of columns whose noise is little.
QUIET = np.full((160, 240), 0.005)


def columns() -> np.ndarray:
    """A tilted plane under noise, with a wave in the left half of the picture."""
    y, x = np.mgrid[:160, :240].astype(float)
    column = 40 + 0.83 * x + 0.113 * y + 0.0004 * x**2
    column[:, :120] += 0.06 * np.sin(np.pi * column[:, :120])
    return np.asarray(column + 0.005 * np.random.default_rng(0).standard_normal(column.shape))


def test_waves_widen_the_deviation_where_they_are() -> None:
    std = wave_std_px(columns(), QUIET, np.ones((160, 240), bool), LINES)
    assert std[:, :120].min() > 0.9 * 0.06 / np.sqrt(2)
    assert std[:, :120].max() < 1.1 * 0.06 / np.sqrt(2)
    assert std[:, 120:].max() < 0.002


def test_noise_that_goes_with_the_place_between_lines_widens_noisy_pixels_alone() -> None:
    """Near the middle of a line as wide as the step, noise displaces columns to either side."""
    lines = LineSet.of(CapturePlan(spectral=ScanLines(width_px=5, step_px=5)))
    assert lines is not None
    y, x = np.mgrid[:160, :240].astype(float)
    column = 40 + 5.83 * x + 0.113 * y + 0.0004 * x**2
    from_middle = (column - lines.first_px + 2.5) % 5 - 2.5
    noisy = np.abs(from_middle) < 0.4
    aside = np.where(noisy, 0.25 * np.sign(from_middle), 0.0)
    column += aside + 0.005 * np.random.default_rng(0).standard_normal(column.shape)
    std = wave_std_px(column, np.where(noisy, 0.25, 0.005), np.ones(column.shape, bool), lines)
    assert std[~noisy].max() < 0.01
    assert std[noisy].min() > 0.05


def test_gaps_hide_no_waves_and_small_pictures_are_asked_as_a_whole() -> None:
    refined = np.ones((160, 240), bool)
    refined[:, ::7] = False
    assert wave_std_px(columns(), QUIET, refined, LINES)[:, :120].min() > 0.8 * 0.06 / np.sqrt(2)
    small = wave_std_px(columns()[:40, :120], QUIET[:40, :120], refined[:40, :120], LINES)
    assert small.min() == small.max() > 0.8 * 0.06 / np.sqrt(2)


def test_nothing_is_said_of_pixels_that_no_single_lines_refined() -> None:
    refined = np.ones((160, 240), bool)
    refined[:, ::2] = False
    assert not wave_std_px(columns(), QUIET, refined, LINES).any()
    assert not wave_std_px(columns(), QUIET, ~refined, None).any()
    comb = LineSet.of(CapturePlan(spectral=LineComb(shifts_px=(0, 0, 0))))
    assert not wave_std_px(columns(), QUIET, np.ones((160, 240), bool), comb).any()


@pytest.mark.parametrize("shape", [(8, 12), (3, 40)])
def test_pictures_too_small_to_tell_have_none(shape: tuple[int, int]) -> None:
    assert not wave_std_px(np.zeros(shape), np.zeros(shape), np.ones(shape, bool), LINES).any()


@pytest.mark.parametrize(("translucent", "follows"), [(0.8, False), (1.0, True)])
def test_a_projector_is_not_out_of_focus_where_any_surface_shows_sharp_lines(
    translucent: float, follows: bool
) -> None:
    known = ProjectorResponse(blur_px=0.6)
    sharp, column = seen(known)
    wide, _ = seen(known.with_gaussian(1.2))
    on_wax = torch.arange(len(column)) // RUN % 10 < 10 * translucent
    peaks = replace(sharp, y=torch.where(on_wax, wide.y, sharp.y))
    place = torch.stack([column, torch.zeros_like(column)])
    found = scene_spread(peaks, column.round(), known, place)
    assert found is not None
    assert found.changed == follows
    assert found.response.blur_px == pytest.approx(1.2 if follows else 0.6, abs=0.02)


def test_colours_whose_waves_are_opposite_hide_none_in_a_mosaic() -> None:
    """A projector focuses blue elsewhere than red: their columns are off to opposite sides."""
    y, x = np.mgrid[:160, :240].astype(float)
    column = 40 + 0.83 * x + 0.113 * y
    sign = np.where((x + y) % 2 == 0, 1.0, -1.0)
    noise = 0.005 * np.random.default_rng(0).standard_normal(column.shape)
    waved = column + sign * 0.06 * np.sin(np.pi * column) + noise
    refined = np.ones(column.shape, bool)
    assert wave_std_px(waved, QUIET, refined, LINES).max() < 0.01
    std = wave_std_px(waved, QUIET, refined, LINES, mosaic=True)
    assert std.min() > 0.9 * 0.06 / np.sqrt(2)
    assert std.max() < 1.1 * 0.06 / np.sqrt(2)
    assert wave_std_px(column + noise, QUIET, refined, LINES, mosaic=True).max() < 0.003
