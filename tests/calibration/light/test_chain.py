"""A diffuser's line scan puts right what curves of response, emission and efficiency have wrong."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.calibration.light.chain import (
    MIN_PIXELS,
    MODEL_STD,
    SCALE_STD,
    UNKNOWNS,
    LineScan,
    _chain_std,
    _mean_ratios,
    _parts,
    _scale,
    _solve,
    chain_correction,
    largest_correction,
)
from dsl_core.calibration.light.chain_equations import ZERO_ORDER_ERROR
from dsl_core.campaign.common.flat_target import diffuser_lines
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.chain import ChainCorrection, apply_chain
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines
from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.smooth_functions import Equations, solve_given
from tests.cases.twin_scan import MemoryScan, twin_scan

NM = np.arange(440.0, 651.0, 10.0)


@pytest.fixture(scope="module")
def scanned() -> tuple[Rig, MemoryScan]:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=2))
    devices, scan = twin_scan(plan, size="112x72", scene="plane")
    assert devices.calibration is not None
    return devices.calibration, scan


@pytest.fixture(scope="module")
def lines(scanned: tuple[Rig, MemoryScan]) -> LineScan:
    return diffuser_lines(scanned[1], scanned[0], pixels=2500)[1]


@pytest.mark.slow
def test_filters_that_are_all_off_alike_are_measured_by_the_leds(
    scanned: tuple[Rig, MemoryScan], lines: LineScan
) -> None:
    # A film of fewer lines sends light of longer wavelengths where it went.
    rig = wrong(scanned[0])
    film = rig.film.model_copy(update={"lines_per_mm": rig.film.lines_per_mm * (1 - 0.004)})
    check_scale(chain_correction(rig.model_copy(update={"film": film}), [lines]), -0.004)


def test_filters_that_are_right_have_a_scale_of_none(corrected: tuple[Rig, Rig, ChainCorrection]) -> None:
    check_scale(corrected[2], 0.0)


def check_scale(record: ChainCorrection, scale: float) -> None:
    assert record.wavelength_scale == pytest.approx(scale, abs=2e-4)
    assert record.wavelength_scale_std < 2e-4


def wrong(rig: Rig) -> Rig:
    """Curves with smooth errors of a few percent, each its own."""

    def bent(curve: SpectralCurve, phase: float) -> SpectralCurve:
        nm = np.array(curve.wavelengths_nm)
        return SpectralCurve.of(nm, np.array(curve.values) * (1 + 0.03 * np.sin(nm / 45.0 + phase)))

    response: Rgb = (
        bent(rig.response[0], 0.0),
        bent(rig.response[1], 1.0),
        bent(rig.response[2], 2.0),
    )
    efficiency = {m: bent(curve, 3.0 + m) for m, curve in rig.efficiency.items()}
    return rig.model_copy(
        update={"response": response, "efficiency": efficiency, "white_scale": 1.05 * rig.white_scale}
    )


def chain_error(rig: Rig, truth: Rig, order: int) -> np.ndarray:
    """Relative error of the chain at `NM`, colours weighted by squared signal."""
    signal, true = (chain_response(r, order, NM).sum(1) for r in (rig, truth))
    weight = true**2 / (true**2).sum(0)
    return np.asarray((weight * (signal / true - 1)).sum(0))


@pytest.fixture(scope="module")
def corrected(scanned: tuple[Rig, MemoryScan], lines: LineScan) -> tuple[Rig, Rig, ChainCorrection]:
    before = wrong(scanned[0])
    return scanned[0], before, chain_correction(before, [lines])


@pytest.mark.parametrize("order", [1, -1])
def test_errors_of_percents_become_tenths(corrected: tuple[Rig, Rig, ChainCorrection], order: int) -> None:
    truth, before, record = corrected
    after = apply_chain(record, before)
    assert np.abs(chain_error(before, truth, order)).max() > 0.05
    left = chain_error(after, truth, order)
    assert np.sqrt(np.mean(left**2)) < 2e-3
    stated = np.hypot(record.chain_rel_std.at(NM), record.white_scale_rel_std)
    assert np.sqrt(np.mean((left / stated) ** 2)) < 1.8
    assert stated.max() < 0.01


def test_the_largest_correction_is_that_of_the_product_where_there_is_light(
    corrected: tuple[Rig, Rig, ChainCorrection],
) -> None:
    truth, before, record = corrected
    expected = max(np.abs(chain_error(before, truth, order)).max() for order in (1, -1))
    assert record.largest_correction == pytest.approx(expected, abs=0.03)
    # Factors of curves that cancel in the product, and of colours where they are dark, do not count.
    red, green, blue = truth.response
    nm = np.array(green.wavelengths_nm)
    dark = SpectralCurve.of(nm, np.array(green.values) * np.where(nm > 665, 0.4, 1.0) / 2)
    halved = SpectralCurve.of(red.wavelengths_nm, np.array(red.values) / 2)
    less = SpectralCurve.of(blue.wavelengths_nm, np.array(blue.values) / 2)
    same = truth.model_copy(update={"response": (halved, dark, less), "white_scale": 2 * truth.white_scale})
    assert largest_correction(truth, same) < 0.02


def test_zero_order_is_put_right_too(corrected: tuple[Rig, Rig, ChainCorrection]) -> None:
    truth, before, record = corrected
    nm = np.arange(400.0, 701.0)
    white = [chain_response(r, 0, nm).sum((1, 2)) for r in (apply_chain(record, before), truth)]
    np.testing.assert_allclose(white[0], white[1], rtol=2e-3)


def test_record_goes_through_json_and_leaves_second_orders(
    corrected: tuple[Rig, Rig, ChainCorrection],
) -> None:
    _, before, record = corrected
    again = ChainCorrection.model_validate_json(record.model_dump_json())
    after = apply_chain(again, before)
    assert after.chain_rel_std == record.chain_rel_std
    assert after.efficiency[2] == before.efficiency[2]


def test_too_few_pixels_are_refused(scanned: tuple[Rig, MemoryScan], lines: LineScan) -> None:
    with pytest.raises(CalibrationError, match="usable pixels"):
        chain_correction(scanned[0], [lines.at(np.arange(20))])


@pytest.mark.slow
def test_saturated_values_do_not_count(scanned: tuple[Rig, MemoryScan], lines: LineScan) -> None:
    rng = np.random.default_rng(0)
    hit = rng.random(lines.radiance.shape) < 0.05
    spoilt = replace(
        lines,
        radiance=np.where(hit, 1e3, lines.radiance),
        std=np.where(hit, np.inf, lines.std),
    )
    record = chain_correction(scanned[0], [spoilt])
    assert np.abs(chain_error(apply_chain(record, scanned[0]), scanned[0], 1)).max() < 0.01


def test_scan_without_lines_is_refused(scanned: tuple[Rig, MemoryScan]) -> None:
    rig, scan = scanned
    comb = MemoryScan(scan.plan.model_copy(update={"spectral": LineComb()}), scan.frames)
    with pytest.raises(CalibrationError, match="has no scan lines"):
        diffuser_lines(comb, rig)


def parts_that_see_the_scale(values: np.ndarray, std: float) -> list[Equations]:
    """Parts of the image that know of nothing but the scale of wavelengths, each its own value."""
    n = UNKNOWNS.count + 1
    normal, right = np.zeros((n, n)), np.zeros((len(values), n))
    normal[-1, -1], right[:, -1] = std**-2, values / std**2
    return [Equations(normal, r, float((v / std) ** 2), 1) for r, v in zip(right, values, strict=True)]


@pytest.mark.parametrize(("noise", "scatter"), [(1e-5, 4e-3), (4e-3, 1e-9)])
def test_the_scale_is_as_unsure_as_its_noise_and_as_parts_of_the_image_differ(
    noise: float, scatter: float
) -> None:
    values = 0.003 + scatter * np.random.default_rng(2).standard_normal(12)
    parts = parts_that_see_the_scale(values, noise)
    total = sum(parts[1:], parts[0])
    n = UNKNOWNS.count
    alone = Equations(total.normal[:n, :n], total.right[:n], total.square, total.count)
    scale, std = _scale(solve_given(alone, np.eye(n), 1.0), total, parts)
    # Twelve samples: the deviation of their mean, or that of their own noise.
    error = np.std(values, ddof=1) / np.sqrt(12)
    assert scale == pytest.approx(values.mean(), abs=0.02 * error + noise * 0.02)
    assert std == pytest.approx(np.hypot(error, noise / np.sqrt(12)), rel=0.02)


def test_without_data_the_scale_is_as_unsure_as_it_was_before() -> None:
    parts = parts_that_see_the_scale(np.zeros(3), 1e6)
    n = UNKNOWNS.count
    alone = Equations(np.zeros((n, n)), np.zeros(n), 0.0, 3)
    scale, std = _scale(solve_given(alone, np.eye(n), 1.0), sum(parts[1:], parts[0]), parts)
    assert scale == 0.0
    assert std == pytest.approx(SCALE_STD)


def test_a_colour_that_no_part_of_the_image_shows_is_taken_as_known_to_no_more_than_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    module = "dsl_core.calibration.light.chain."
    monkeypatch.setattr(module + "_parts", lambda _rig, scan: dict(enumerate(scan)))
    monkeypatch.setattr(module + "zero_order_ratios", lambda _rig, part, _target: np.array(part, float))
    monkeypatch.setattr(module + "colours_of", lambda *_: np.array([0, 0, 2]))
    parts: Any = [[0.9, 0.9, 2.0], [1.1, 1.1, 2.0]]
    target: Any = None
    mean, std = _mean_ratios(published_rig(), [parts], target)
    assert mean == pytest.approx([1.0, 1.0, 2.0])
    assert std == pytest.approx(np.hypot([0.1 / np.sqrt(2), 1.0, 0.0], ZERO_ORDER_ERROR))


def test_chi_square_is_that_of_the_first_orders_with_the_deviation_of_three_colours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng, count = np.random.default_rng(1), UNKNOWNS.count
    design = rng.standard_normal((400, count + 1))
    design[:, -1] = 0.0
    std = rng.uniform(0.5, 2.0, 400)
    target = design[:, :-1] @ (0.02 * rng.standard_normal(count)) + std * rng.standard_normal(400)
    zero = Equations.of(rng.standard_normal((3, count + 1)), rng.standard_normal(3), np.full(3, 0.5))
    module = "dsl_core.calibration.light.chain."
    halves: Any = [
        Equations.of(design[part], target[part], std[part]) for part in (slice(200), slice(200, 400))
    ]
    monkeypatch.setattr(module + "_parts", lambda *_: {(0, 0): 0, (0, 1): 1})
    monkeypatch.setattr(module + "first_order_equations", lambda rig, part, *_: halves[part])
    monkeypatch.setattr(module + "zero_order_equations", lambda *_: zero)
    ratio_std = np.array([0.01, 0.02, 0.02])
    monkeypatch.setattr(module + "_mean_ratios", lambda *_: (np.ones(3), ratio_std))
    scan: Any = SimpleNamespace(pixels=np.zeros(MIN_PIXELS, int))
    found = _solve(published_rig(), [scan], None, None)  # type: ignore[arg-type]
    left = (target - design[:, :-1] @ found.solution.values) / std
    assert found.chi_square == pytest.approx(float((left**2).mean()))
    every = halves[0] + halves[1] + zero
    alone = Equations(every.normal[:-1, :-1], every.right[:-1], every.square, every.count)
    again = solve_given(alone, found.solution.prior, found.solution.noise_factor)
    assert found.solution.values == pytest.approx(again.values)
    # Three colours of these deviations, each a third of the mean.
    assert found.ratio_std == pytest.approx(0.03 / 3)
    assert found.pixels == 50
    few: Any = SimpleNamespace(pixels=np.zeros(MIN_PIXELS - 1, int))
    with pytest.raises(CalibrationError, match="49 usable pixels; 50 are needed"):
        _solve(published_rig(), [few], None, None)  # type: ignore[arg-type]


def test_an_image_has_three_parts_down_and_four_across(lines: LineScan) -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(112, 72)})
    parts = _parts(rig, lines)
    assert sorted(parts) == [(y, x) for y in range(3) for x in range(4)]
    for (down, across), part in parts.items():
        rows, columns = np.divmod(part.pixels, 112)
        assert set((rows // 24).tolist()) == {down}
        assert set((columns // 28).tolist()) == {across}
    assert sum(len(part.pixels) for part in parts.values()) == len(lines.pixels)


def test_the_chain_is_no_surer_than_its_model_whatever_frames_and_places_say(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("dsl_core.calibration.light.chain._product", lambda *_: np.eye(2))

    def std(covariance: float, of_mean: float, of_place: float) -> NDArray[np.float64]:
        solution: Any = SimpleNamespace(covariance=covariance * np.eye(2))
        left_out: Any = SimpleNamespace(
            variance_of_mean=lambda _: np.full(2, of_mean), variance_of_place=lambda _: np.full(2, of_place)
        )
        return _chain_std(published_rig(), 1, solution, left_out)

    assert std(0.0, 0.0, 0.0) == pytest.approx([MODEL_STD] * 2)
    assert std(1e-4, 2e-4, 1e-4) == pytest.approx([np.hypot(0.02, MODEL_STD)] * 2)


def test_the_diffuser_is_the_white_that_the_light_refers_to_unless_another_one_is_stated(
    corrected: tuple[Rig, Rig, ChainCorrection], lines: LineScan
) -> None:
    _, before, usual = corrected
    grey = before.model_copy(update={"white_reflectance": SpectralCurve.of([400.0, 700.0], [0.9, 0.9])})
    known = chain_correction(grey, [lines])
    assert known == chain_correction(before, [lines], reflectance=0.9)
    assert known.white_scale_factor > 1.05 * usual.white_scale_factor
