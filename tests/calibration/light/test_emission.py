"""Emission from spectra with noise: unbiased, deviations honest, wrong spectra named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsl_core.calibration.light.emission import (
    SmoothCurve,
    _check_leds,
    _envelope,
    _smoothed,
    _variance,
    _with_white,
    measured_emission,
    smooth_curve,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.spectralon import (
    COLOURS,
    EMISSION_SUM_NM,
    EmissionReadings,
    LightColour,
    MeasuredEmission,
)
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.published_rig import published_rig

NM = np.arange(400.0, 701.0)
#: Emission in place of which something else is looked at.
NOTHING = MeasuredEmission.model_construct()
WHITE = SpectralCurve.of([400, 700], [0.95, 0.99])
LIGHT: dict[LightColour, tuple[int, int, int]] = {
    "red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1), "white": (1, 1, 1), "black": (0, 0, 0),
}  # fmt: skip


def readings(noise: float = 0.002, count: int = 8, seed: int = 0, nm: np.ndarray = NM) -> EmissionReadings:
    """Spectra as an instrument with noise would read them, other light of the room included."""
    rng = np.random.default_rng(seed)
    leds = np.stack([curve.at(nm) for curve in published_rig().emission]) * WHITE.at(nm)
    made: dict[LightColour, tuple[SpectralCurve, ...]] = {}
    for colour in COLOURS:
        value = np.array(LIGHT[colour]) @ leds + 0.01
        made[colour] = tuple(
            SpectralCurve.of(nm, 3e-3 * (value + noise * value.max() * rng.standard_normal(nm.size)))
            for _ in range(count)
        )
    return EmissionReadings(source="test", readings=made)


def scaled_truth() -> np.ndarray:
    leds = np.stack([curve.at(NM) for curve in published_rig().emission])
    return np.asarray(leds * EMISSION_SUM_NM / (leds * np.gradient(NM)).sum())


def test_emission_is_right_within_its_deviation() -> None:
    errors, stds = [], []
    for seed in range(3):
        found = measured_emission(readings(seed=seed), WHITE)
        errors.append(np.stack([c.at(NM) for c in found.curves]) - scaled_truth())
        stds.append(np.stack([np.array(c.std) for c in found.curves]))
        assert abs(found.additivity - 1) < 4 * found.additivity_std
    error, std = np.array(errors), np.array(stds)
    covered = np.mean(np.abs(error) < 1.96 * std)
    assert 0.88 < covered < 0.99
    # Far better than one reading, and no peak flattened.
    assert np.sqrt((error**2).mean()) < 0.0005 * scaled_truth().max()
    peaks = [int(led.argmax()) for led in scaled_truth()]
    for led, peak in enumerate(peaks):
        assert abs(error[:, led, peak].mean()) < 2.5 * std[:, led, peak].mean()


@pytest.mark.parametrize(("step_nm", "most"), [(5.0, 0.003), (10.0, 0.009)])
def test_between_values_that_are_far_apart_a_curve_is_smooth_and_as_unsure_as_it_is(
    step_nm: float, most: float
) -> None:
    nm = np.arange(400.0, 701.0, step_nm)
    found = measured_emission(readings(nm=nm), WHITE)
    truth = scaled_truth()
    fitted = np.stack([curve.at(NM) for curve in found.curves])
    error = fitted * (fitted * truth).sum() / (fitted**2).sum() - truth
    std = np.stack([np.interp(NM, curve.wavelengths_nm, np.array(curve.std)) for curve in found.curves])
    assert np.sqrt((error**2).mean()) < most * truth.max()
    assert np.mean(np.abs(error) < 2 * std) > 0.88


def test_values_too_far_apart_for_a_peak_are_refused() -> None:
    with pytest.raises(CalibrationError, match="up to 20 nm apart"):
        measured_emission(readings(nm=np.arange(400.0, 701.0, 20.0)), WHITE)


def test_values_far_apart_where_leds_give_no_light_are_taken() -> None:
    """Instruments that see from ultraviolet to infrared have coarser steps out there."""
    inside = np.arange(400.0, 701.0, 1.0)
    wide = np.concatenate([np.arange(200.0, 400.0, 20.0), inside, np.arange(720.0, 1001.0, 20.0)])
    found, fine = (measured_emission(readings(nm=nm), WHITE).curves[1].at(inside) for nm in (wide, inside))
    assert np.abs(found - fine).max() < 0.02 * fine.max()


def test_a_single_reading_knows_its_noise() -> None:
    found = measured_emission(readings(count=1), WHITE)
    error = np.stack([c.at(NM) for c in found.curves]) - scaled_truth()
    std = np.stack([np.array(c.std) for c in found.curves])
    assert 0.85 < np.mean(np.abs(error) < 1.96 * std) < 0.995


def test_smoothing_leaves_exact_data_alone() -> None:
    value = published_rig().emission[0].at(NM)
    smooth = smooth_curve(NM, value, np.full(NM.size, 1e-6))
    np.testing.assert_allclose(smooth.values, value, atol=1e-5)


def test_white_in_another_unit_shows() -> None:
    made = readings()
    white = tuple(SpectralCurve.of(NM, np.array(c.values) * 1e3) for c in made.readings["white"])
    other = made.model_copy(update={"readings": {**made.readings, "white": white}})
    assert measured_emission(other, WHITE).additivity > 100


def test_exchanged_missing_and_dark_spectra_are_named() -> None:
    made = readings().readings
    wrong: dict[str, dict[LightColour, tuple[SpectralCurve, ...]]] = {
        "swapped": {**made, "red": made["blue"], "blue": made["red"]},
        "green is missing": {colour: curves for colour, curves in made.items() if colour != "green"},
        "Under blue": {**made, "blue": made["black"]},
    }
    for told, spectra in wrong.items():
        with pytest.raises(CalibrationError, match=told):
            measured_emission(EmissionReadings(source="test", readings=spectra), WHITE)


def test_white_improves_the_leds_as_all_five_readings_together_would() -> None:
    """Readings of red, green, blue, white and black, of which black is in each of the others."""
    rng = np.random.default_rng(4)
    red, green, blue, white, black = rng.uniform(1.0, 3.0, 5)
    noise = dict(zip(("red", "green", "blue", "white", "black"), (0.3, 0.2, 0.5, 0.1, 0.05), strict=True))
    each = {name: np.array([value]) for name, value in noise.items()}
    leds = np.array([[red - black], [green - black], [blue - black]])
    spread = np.stack([each[name] + each["black"] for name in ("red", "green", "blue")])
    found, variance = _with_white(leds, np.array([white - black]), spread, each)  # type: ignore[arg-type]
    design = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1], [1, 1, 1, 1], [0, 0, 0, 1.0]])
    weight = np.diag(1 / np.array(list(noise.values())))
    covariance = np.linalg.inv(design.T @ weight @ design)
    wanted = covariance @ design.T @ weight @ [red, green, blue, white, black]
    assert found[:, 0] == pytest.approx(wanted[:3])
    assert variance[:, 0] == pytest.approx(np.diag(covariance)[:3])


def test_the_variance_of_readings_is_their_scatter_or_the_roughness_of_one() -> None:
    rng = np.random.default_rng(5)
    stack = 3.0 + 0.2 * rng.standard_normal((6, 4000))
    found = _variance(stack)
    assert found.mean() == pytest.approx(0.04, rel=0.02)
    # Pooled over 31 wavelengths of five degrees of freedom each.
    assert found.std() == pytest.approx(0.04 * np.sqrt(2 / (5 * 31)), rel=0.15)
    smooth = np.sin(np.arange(4000) / 400)
    assert _variance((smooth + 0.2 * rng.standard_normal(4000))[None])[0] == pytest.approx(0.04, rel=0.06)


@pytest.mark.parametrize(("share", "dark"), [(2e-3, False), (0.5e-3, True)])
def test_an_led_of_less_than_a_thousandth_of_the_strongest_is_dark(share: float, dark: bool) -> None:
    nm = np.arange(400.0, 701.0)
    leds = np.stack([np.exp(-(((nm - centre) / 20) ** 2)) for centre in (630, 530, 450)])
    leds[1] *= share
    if dark:
        with pytest.raises(CalibrationError, match="Under green"):
            _check_leds(nm, leds)
    else:
        _check_leds(nm, leds)
        with pytest.raises(CalibrationError, match="out of order"):
            _check_leds(nm, leds[[1, 0, 2]])


def test_the_deviation_of_white_over_its_parts_is_that_of_seven_readings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """White, red, green and blue once and black twice too often, which counts four times."""
    variances = dict(zip(COLOURS, (1.0, 2.0, 3.0, 4.0, 5.0), strict=True))
    made = readings(count=1)
    means = {c: made.readings[c][0].at(NM) for c in COLOURS}
    stated = {c: np.full(NM.size, variances[c]) for c in COLOURS}
    monkeypatch.setattr("dsl_core.calibration.light.emission._means", lambda *_: (means, stated))
    kept = list[Any]()

    def smoothed(*parts: Any) -> MeasuredEmission:
        kept.append(parts)
        return NOTHING

    monkeypatch.setattr("dsl_core.calibration.light.emission._smoothed", smoothed)
    measured_emission(made, WHITE)
    white = WHITE.at(NM)
    step = np.gradient(NM)
    total = (sum(means[c] - means["black"] for c in ("red", "green", "blue")) / white * step).sum()
    _, _, std, (additivity, additivity_std), count = kept[0]
    assert additivity == pytest.approx(((means["white"] - means["black"]) / white * step).sum() / total)
    miss = (1 + 2 + 3 + 4 + 4 * 5) / white**2
    assert additivity_std == pytest.approx(float(np.sqrt((miss * step**2).sum()) / total))
    assert count == 1
    # White makes each LED surer than its own reading and that of black.
    assert (std[0] ** 2 < (1 + 5) / white**2).all()


@pytest.mark.parametrize(("factor", "is_used"), [(1.009, True), (1.011, False)])
def test_white_is_used_where_it_is_the_sum_to_a_percent(
    factor: float, is_used: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, used = readings(count=1), list[int]()
    means = {c: made.readings[c][0].at(NM) for c in COLOURS}
    parts = sum(means[c] - means["black"] for c in ("red", "green", "blue"))
    means["white"] = means["black"] + factor * parts
    stated = {c: np.ones(NM.size) for c in COLOURS}
    monkeypatch.setattr("dsl_core.calibration.light.emission._means", lambda *_: (means, stated))
    monkeypatch.setattr("dsl_core.calibration.light.emission._smoothed", lambda *_: NOTHING)

    def noted(leds: Any, white: Any, spread: Any, noise: Any) -> Any:
        used.append(1)
        return leds, spread

    monkeypatch.setattr("dsl_core.calibration.light.emission._with_white", noted)
    measured_emission(made, WHITE)
    assert bool(used) == is_used


def test_a_curve_is_the_most_likely_one_of_all_scales_and_lengths() -> None:
    """Against the evidence of each written out: half, as, twice and four times as large as it looks."""
    nm = np.arange(500.0, 540.0)
    noise = np.full(40, 0.05)
    values = np.sin(nm / 3) + noise * np.random.default_rng(2).standard_normal(40)
    peak = np.abs(values).max()
    y, sigma = values / peak, noise / peak
    envelope = _envelope(nm, y, sigma)
    best = (-np.inf, np.zeros(40), np.zeros(40))
    for length in np.geomspace(5.0, 160.0, 14):
        for scale in (0.5, 1.0, 2.0, 4.0):
            d = np.sqrt(3.0) * np.abs(nm[:, None] - nm) / length
            prior = scale**2 * (1 + d) * np.exp(-d) * np.outer(envelope, envelope)
            total = prior + np.diag(sigma**2)
            inverse = np.linalg.inv(total)
            evidence = -0.5 * y @ inverse @ y - 0.5 * np.linalg.slogdet(total)[1]
            if evidence > best[0]:
                best = (evidence, prior @ inverse @ y, np.diag(prior - prior @ inverse @ prior))
    found = smooth_curve(nm, values, noise)
    assert found.values == pytest.approx(peak * best[1], abs=1e-9)
    assert found.std == pytest.approx(peak * np.sqrt(best[2]), rel=1e-6)


@pytest.mark.parametrize("scale", [0.3, 5.0])
def test_scales_reach_from_half_to_four_times(scale: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a curve far smaller or larger than its envelope the nearest scale is chosen."""
    nm = np.arange(500.0, 620.0)
    monkeypatch.setattr("dsl_core.calibration.light.emission._envelope", lambda *_: np.full(120, 1 / scale))
    monkeypatch.setattr("dsl_core.calibration.light.emission.LENGTHS_NM", np.array([20.0]))
    values = np.sin(nm / 10)
    found = smooth_curve(nm, values, np.full(120, 0.3))
    nearest = 0.5 if scale < 1 else 4.0
    peak = np.abs(values).max()
    d = np.sqrt(3.0) * np.abs(nm[:, None] - nm) / 20.0
    prior = (nearest / scale) ** 2 * (1 + d) * np.exp(-d)
    wanted = prior @ np.linalg.solve(prior + np.eye(120) * (0.3 / peak) ** 2, values)
    assert found.values == pytest.approx(wanted, abs=1e-9)


def test_curves_share_a_scale_and_what_is_left_at_their_ends_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    nm = np.arange(500.0, 520.0)
    leds = np.zeros((3, 20))
    leds[0, 5:15], leds[1, 5:15], leds[2, 5:15] = 2.0, 3.0, 5.0
    leds[0, 0], leds[1, -1], leds[1, 1], leds[2, 3] = 0.2, 0.6, 3.0, -1.0

    def same(_nm: np.ndarray, values: np.ndarray, std: np.ndarray, _at_nm: np.ndarray) -> SmoothCurve:
        return SmoothCurve(values, std, 10 * values.max())

    monkeypatch.setattr("dsl_core.calibration.light.emission.smooth_curve", same)
    found = _smoothed(nm, leds, np.full((3, 20), 0.1), (1.02, 0.01), 7)
    scale = EMISSION_SUM_NM / leds.sum()
    assert [max(curve.values) for curve in found.curves] == pytest.approx([2 * scale, 3 * scale, 5 * scale])
    assert found.curves[2].values[3] == 0.0
    assert found.curves[1].std == pytest.approx([0.1 * scale] * 20)
    assert found.end_share == pytest.approx(0.2)
    assert found.smoothing_nm == (20.0, 30.0, 50.0)
    assert (found.additivity, found.additivity_std, found.readings) == (1.02, 0.01, 7)


def test_leds_are_in_order_however_unevenly_wavelengths_are_spaced() -> None:
    nm = np.concatenate([np.arange(400.0, 590.0), np.arange(590.0, 701.0, 5.0)])
    leds = np.stack([curve.at(nm) for curve in published_rig().emission])
    _check_leds(nm, leds)
    with pytest.raises(CalibrationError, match="swapped"):
        _check_leds(nm, leds[::-1])
