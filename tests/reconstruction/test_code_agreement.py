"""What the binary code says of lines that moved, and of lenses and a pose that are not as calibrated."""

from __future__ import annotations

import re
from itertools import pairwise
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.devices.base import DeviceRig
from dsl_core.evaluation.summary import Evaluation
from dsl_core.model.fit import Fit, FitFinding
from dsl_core.model.geometry import Pose
from dsl_core.model.plan import BinaryCode, CapturePlan, EnsembleCode, GrayCode, ScanLines, Setting, XorCode
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.code_agreement import (
    Disagreement,
    NamedPlaces,
    _cause_of,
    _of_columns,
    displacement,
    whole_columns,
)
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.reconstruction.named_rows import named_rows
from dsl_core.words import counted
from dsl_core.workflows import truths
from tests.cases.small_rig import small_rig
from tests.cases.twin_scan import MemoryScan, twin_scan


@pytest.fixture(scope="module")
def scanned() -> tuple[DeviceRig, MemoryScan]:
    """A plane seen in 80 x 52 pixels, by one setting and few lines."""
    plan = CapturePlan(
        spectral=ScanLines(step_px=4), settings=(Setting(exposure_ms=20.0, level=0.8),), code_settings=(0,)
    )
    return twin_scan(plan, size="80x52", scene="color-checker")


def findings(
    scanned: tuple[DeviceRig, MemoryScan], rig: Rig, scan: MemoryScan
) -> tuple[dict[str, FitFinding], Evaluation]:
    result = pipeline.reconstruct(scan, rig, pipeline.Options(spectra=False))
    fit = Fit.read(result.attrs)
    truth = truths.twin_truth(scanned[0], WavelengthGrid())
    assert fit is not None
    assert truth is not None
    return {f.name.split()[0]: f for f in fit.findings if "binary code" in f.name}, pipeline.evaluate(
        result, truth
    )


def calibration_of(devices: DeviceRig) -> Rig:
    assert devices.calibration is not None
    return devices.calibration


def turned(rig: Rig, degrees: float) -> Rig:
    """The rig with the projector turned about the vertical."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    rotation, translation = turn @ rig.pose.matrix, turn @ rig.pose.vector_mm
    a, b, c3 = (tuple(row) for row in rotation.tolist())
    return rig.model_copy(update={"pose": Pose(rotation=(a, b, c3), translation_mm=tuple(translation))})


def held(evaluation: Evaluation) -> float:
    assert evaluation.depth_calibration is not None
    return evaluation.depth_calibration.coverage_95


@pytest.mark.slow
def test_nothing_is_found_where_all_is_as_calibrated(scanned: tuple[DeviceRig, MemoryScan]) -> None:
    found, _ = findings(scanned, calibration_of(scanned[0]), scanned[1])
    assert found["rows"].value < 0.02
    assert found["lines"].value < 0.03
    assert not any(each.significant for each in found.values())


@pytest.mark.slow
def test_a_projector_turned_since_calibration_is_told_and_depth_says_how_unsure_it_is(
    scanned: tuple[DeviceRig, MemoryScan],
) -> None:
    found, evaluation = findings(scanned, turned(calibration_of(scanned[0]), 0.05), scanned[1])
    assert evaluation.depth is not None
    assert abs(evaluation.depth.bias_mm) > 3.0
    assert found["rows"].significant
    assert not found["lines"].significant
    assert held(evaluation) > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("columns", [-2, 1])
def test_a_picture_displaced_by_whole_columns_is_told_from_other_lenses(
    scanned: tuple[DeviceRig, MemoryScan], columns: int
) -> None:
    rig = calibration_of(scanned[0])
    lens = rig.projector.model_copy(update={"cx_px": rig.projector.cx_px + columns})
    found, _ = findings(scanned, rig.model_copy(update={"projector": lens}), scanned[1])
    assert found["rows"].significant
    assert f"pattern moved by {counted(abs(columns), 'column')} " in found["rows"].sentence


def test_rows_are_displaced_by_whole_columns_if_these_explain_all_of_them() -> None:
    slope, std = np.array([0.25, 0.3, 0.2, -0.1, np.nan]), np.full(5, 0.01)
    assert whole_columns(2 * slope, std, slope) == 2
    assert whole_columns(-1.1 * slope, std, slope) == -1
    assert whole_columns(1.4 * slope, std, slope) == 0
    assert whole_columns(slope + np.array([0.2, -0.2, 0.2, 0.0, 0.0]), std, slope) == 0
    assert whole_columns(2 * slope, np.array([0.01, 0.01, 0.01, 0.2, 0.01]), slope) == 0, "too few tell"
    assert whole_columns(2 * slope, std, 0 * slope) == 0


@pytest.mark.slow
def test_lines_that_lie_beside_the_code_everywhere_are_told(scanned: tuple[DeviceRig, MemoryScan]) -> None:
    devices, scan = scanned
    lines = [shot.index for shot in scan.plan.shots() if shot.role == "spectral"]
    moved = list(scan.frames)
    for now, after in pairwise(lines):
        # A mean of two lines, one step of 4 columns apart, is displaced.
        moved[now] = np.round(0.86 * scan.frames[now] + 0.14 * scan.frames[after]).astype(np.uint16)
    found, evaluation = findings(scanned, calibration_of(devices), MemoryScan(scan.plan, tuple(moved)))
    assert found["lines"].significant
    # All lines have the same second one beside them: that may as well be how the projector shows lines.
    assert "less even than calibrated, or the projector's picture" in found["lines"].sentence
    # What a line lights is taken to be nearer to its own place than it is.
    told = re.search(r"\(rms, at most ([+-]\d\.\d+)\)", found["lines"].sentence)
    assert told is not None
    assert -1.0 < float(told[1]) < -0.1
    assert 0.1 < found["lines"].value < 0.5
    assert held(evaluation) > 0.9


def test_only_what_is_alike_in_neighbouring_columns_has_moved() -> None:
    noise = 0.02 * np.random.default_rng(2).standard_normal(60)
    drift, wave, std = np.linspace(0, 0.4, 60), 0.2 * np.sin(2.2 * np.arange(60)), np.full(60, 0.02)
    for shift, part, words in (
        (drift + noise, "motion", "moved between"),
        (np.where(drift > 0.2, 0.25, 0.0) + noise, "motion", "moved between"),
        (0.5 + noise, "motion", "moved between"),
        (0.2 + noise, "geometry", "less even than calibrated, or"),
        (wave + noise, "geometry", "nothing that moved explains it"),
    ):
        found = _cause_of(Disagreement(shift, std), 0.6)
        assert (found[0], words in found[1]) == (part, True)


@pytest.mark.parametrize("code", [GrayCode(), XorCode(), EnsembleCode()])
def test_rows_are_named_to_a_pixel_whatever_the_code(code: BinaryCode) -> None:
    shift, std = off(small_rig(), code)
    assert shift == pytest.approx(0, abs=0.03)
    assert std < 0.05


def test_light_of_the_first_orders_moves_the_ends_of_stripes_by_less_than_a_row() -> None:
    pixels, depth = np.arange(0, 890 * 580, 211), np.full(2447, 700.0)
    exact, rows = named_rows(small_rig(), GrayCode(), pixels, depth)
    plain = named_rows(small_rig().model_copy(update={"efficiency": {}}), GrayCode(), pixels, depth)[1]
    inside = (exact > 1) & (exact < 358) & (rows >= 0) & (plain >= 0)
    assert 0.02 < (rows != plain)[inside].mean() < 0.3
    assert (np.abs(rows - plain)[inside] <= 1).all()
    assert (plain[inside] == np.round(exact[inside])).mean() > 0.95


@pytest.mark.parametrize("moved_px", [0.0, 0.4])
def test_pixels_that_cannot_tell_the_finest_stripes_are_no_lines_that_moved(moved_px: float) -> None:
    """A pixel of a small picture sees several columns, and its code names any of them."""
    random = np.random.default_rng(5)
    exact = random.uniform(100, 500, 4000)
    named = np.rint(exact + moved_px + 0.8 * random.standard_normal(exact.size)).astype(int)
    shift, std = displacement(named, exact, (exact / 100).astype(int), 6)
    assert np.abs(shift[1:5] - moved_px).max() < 0.1
    assert (np.abs(shift[1:5] - moved_px) < 4 * std[1:5]).all()


def off(rig: Rig, code: BinaryCode) -> tuple[float, float]:
    """By how much the rows that a code names are off where they are from 120 to 220, and the deviation."""
    pixels = np.arange(0, 890 * 580, 211)
    exact, rows = named_rows(rig, code, pixels, np.full(pixels.size, 700.0))
    inside = (exact > 120) & (exact < 220) & (rows >= 0)
    shift, std = displacement(rows[inside], exact[inside], np.zeros(inside.sum(), int), 1)
    return float(shift[0]), float(std[0])


def test_a_displacement_is_found_below_a_pixel_and_unknown_at_one_phase() -> None:
    rng = np.random.default_rng(0)
    exact = rng.uniform(0, 100, 600)
    group = np.repeat([0, 1, 2], 200)
    exact[group == 1] = np.floor(exact[group == 1])
    named = np.round(exact + 0.3).astype(np.int32)
    named[::17] = 3
    shift, std = displacement(named, exact, group, 4)
    assert shift[[0, 2]] == pytest.approx(0.3, abs=0.05)
    assert (std[[0, 2]] < 0.05).all()
    assert std[1] > 0.15
    assert np.isnan(shift[3])


@pytest.mark.parametrize(("blur_px", "told"), [(0.6, True), (1.7, False)])
def test_columns_of_a_code_whose_finest_stripes_are_blurred_tell_of_no_motion(
    blur_px: float, told: bool
) -> None:
    """There the code itself is off by one column or two."""
    exact = np.random.default_rng(5).uniform(100, 500, (60, 80))
    named = NamedPlaces(np.rint(exact + 0.8).astype(np.int32), None)
    geometry = cast(Geometry, SimpleNamespace(column_px=exact))
    found = _of_columns(named, geometry, np.ones(exact.shape, bool), blur_px)
    assert found is not None
    assert found[0].significant == told
    assert (found[1] > 0) == told


def test_columns_that_are_parallel_to_those_of_the_picture_tell_of_no_motion() -> None:
    """Each group of columns then sees but one phase or two, and some of its pixels are off."""
    rng = np.random.default_rng(5)
    true = np.tile(100.2 + 5.7 * np.arange(80), (60, 1))
    odd = (rng.random(true.shape) < 0.08) * rng.normal(0, 0.3, true.shape)
    geometry = cast(Geometry, SimpleNamespace(column_px=true + odd + rng.normal(0, 0.01, true.shape)))
    named = NamedPlaces(np.rint(true).astype(np.int32), None)
    found = _of_columns(named, geometry, np.ones(true.shape, bool), 0.6)
    assert found is None or (found[0].significant, found[1]) == (False, 0.0)


@pytest.mark.parametrize(("moved_px", "held_px"), [(0.0, 0.0), (0.06, 0.06)])
def test_depth_is_as_unsure_as_the_code_says_where_that_is_too_little_for_words(
    moved_px: float, held_px: float
) -> None:
    exact = np.random.default_rng(5).uniform(100, 500, (120, 160))
    named = NamedPlaces(np.rint(exact + moved_px).astype(np.int32), None)
    geometry = cast(Geometry, SimpleNamespace(column_px=exact))
    found = _of_columns(named, geometry, np.ones(exact.shape, bool), 0.6)
    assert found is not None
    assert not found[0].significant
    assert found[1] == pytest.approx(held_px, abs=0.01)
