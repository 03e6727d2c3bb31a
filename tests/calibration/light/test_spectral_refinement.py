"""Response and emission from known surfaces: better than the start, with honest deviations."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.colour.color_checker import LIGHTS
from dsl_core.calibration.light.spectral_refinement import (
    FINE_NM,
    PUBLISHED_WEIGHT,
    REFLECTANCE_ERRORS,
    WEIGHTS,
    SpectralModel,
    SurfaceSignals,
    _basis,
    _prior,
    _relative_std,
    _shape_std,
    _total_std,
    _unit,
    refine,
    refined_curves,
    residuals,
)
from dsl_core.calibration.light.spectralon import match_whites
from dsl_core.errors import Cancelled
from dsl_core.model.calibration.spectralon import WhiteSignals
from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.charts import chart_reflectance
from dsl_core.progress import CallbackProgress, CancelToken
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig

BANDS = (FINE_NM >= 430) & (FINE_NM <= 660)


def surfaces(true: Rig, noise: float, seed: int = 0) -> SurfaceSignals:
    """What the true rig sees of the chart and of white."""
    chart = np.stack(list(chart_reflectance(FINE_NM).values()))
    reflectance = np.concatenate([chart, np.ones((1, FINE_NM.size))])
    shape = (len(reflectance), 3, len(LIGHTS))
    own = np.arange(len(reflectance)) < len(chart)
    empty = SurfaceSignals(np.zeros(shape), np.ones(shape), reflectance, LIGHTS, own)
    model = SpectralModel(true)
    signal, _ = model.predict(np.zeros(model.size), empty)
    std = noise * signal + 0.1 * noise * signal.max()
    noisy = signal + std * np.random.default_rng(seed).standard_normal(shape)
    return SurfaceSignals(noisy, std, reflectance, LIGHTS, own)


def known_emission(true: Rig, rel_std: float = 0.001) -> Rgb:
    red, green, blue = (
        SpectralCurve.of(FINE_NM, c.at(FINE_NM)).model_copy(
            update={"std": tuple((rel_std * c.at(FINE_NM) + 1e-5).tolist())}
        )
        for c in true.emission
    )
    return red, green, blue


def response_error(rig_or: Rgb, true: Rig) -> np.ndarray:
    """Error over the bands (3, bands) as a share of each peak, common scale left out."""
    given = np.stack([c.at(FINE_NM) for c in rig_or])
    truth = np.stack([c.at(FINE_NM) for c in true.response])
    error = given * truth.sum() / given.sum() - truth
    return np.asarray((error / truth.max(1, keepdims=True))[:, BANDS])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 4))
def test_refined_response_is_better_than_the_data_sheet(seed: int) -> None:
    true, nominal = random_rig(seed, published_rig()), published_rig()
    start = nominal.model_copy(update={"emission": known_emission(true)})
    data = surfaces(true, 3e-4)
    found = refine(start, data, weight=None)
    response, _, _ = refined_curves(start, found)
    before, after = response_error(nominal.response, true), response_error(response, true)
    for channel in range(3):
        assert np.sqrt((after[channel] ** 2).mean()) < 0.4 * np.sqrt((before[channel] ** 2).mean())
    std = np.stack([np.array(c.std)[BANDS] / max(c.values) for c in response])
    assert np.mean(np.abs(after) < 1.96 * std) > 0.85
    assert all(min(curve.values) >= 0 for curve in response)


def test_the_evidence_has_no_gap_of_more_than_a_decade_among_its_weights() -> None:
    decades = np.diff(np.log10(WEIGHTS))
    assert (decades > 0).all()
    assert decades.max() < 1.01
    assert PUBLISHED_WEIGHT in WEIGHTS
    # From a tenth of a percent, which no chart is better than, to what a chart in poor condition has.
    assert np.diff(np.log10(REFLECTANCE_ERRORS[1:])) == pytest.approx(0.5, abs=0.03)
    assert (REFLECTANCE_ERRORS[0], REFLECTANCE_ERRORS[1]) == (0.0, 0.001)


def test_intensities_count_relative_to_the_white_of_their_channel() -> None:
    """So that the published weight means what it does for intensities between zero and one."""
    data = surfaces(published_rig(), 1e-3)
    white = data.signal.max((0, 2), keepdims=True) * np.ones(data.signal.shape)
    assert _unit(data, 0.01 * white) == pytest.approx(1e-4)
    # A channel that is brighter, with its noise, has no more to say; less noise anywhere has.
    gain = np.array([10.0, 1.0, 0.1])[:, None]
    bright = SurfaceSignals(gain * data.signal, data.std, data.reflectance, data.lights, data.own_level)
    assert _unit(bright, 0.01 * gain * white) == pytest.approx(1e-4)
    half = np.where(np.arange(len(white)) % 2, 0.01, 0.02)[:, None, None] * white
    assert 1e-4 < _unit(data, half) < 2.5e-4


@pytest.mark.parametrize("weight", [1e-5, 1.0])
def test_a_weight_smooths_alike_whatever_unit_signals_are_in(weight: float) -> None:
    true = random_rig(1, published_rig())
    data = surfaces(true, 1e-3)
    start = published_rig().model_copy(update={"emission": known_emission(true)})
    dim = start.model_copy(update={"white_scale": 1e-3 * start.white_scale})
    scaled = SurfaceSignals(
        1e-3 * data.signal, 1e-3 * data.std, data.reflectance, data.lights, data.own_level
    )
    one, other = refine(start, data, weight), refine(dim, scaled, weight)
    np.testing.assert_allclose(one.deviation, other.deviation, atol=1e-6)


def test_derivatives_are_those_of_the_signals() -> None:
    model, data = SpectralModel(published_rig()), surfaces(published_rig(), 1e-3)
    x = 0.1 * np.random.default_rng(1).standard_normal(model.size)
    signal, slope = model.predict(x, data)
    step = 1e-5
    for k in (8, 31, 48, 63, 110, 140, model.size - 1):
        ahead, behind = x.copy(), x.copy()
        ahead[k] += step
        behind[k] -= step
        numeric = (model.predict(ahead, data)[0] - model.predict(behind, data)[0]) / (2 * step)
        np.testing.assert_allclose(slope[..., k], numeric, rtol=1e-4, atol=1e-7 * signal.max())


def test_true_curves_stay() -> None:
    true = published_rig()
    start = true.model_copy(update={"emission": known_emission(true)})
    data = surfaces(true, 3e-4)
    response, emission, white_scale = refined_curves(start, refine(start, data, weight=None))
    assert np.abs(response_error(response, true)).max() < 0.01
    assert white_scale == pytest.approx(true.white_scale, rel=2e-3)
    for new, old in zip(emission, true.emission, strict=True):
        assert np.abs(np.array(new.values) - old.at(FINE_NM)).max() < 0.005 * max(old.values)


def test_a_measured_emission_is_not_flattened_by_the_published_weight() -> None:
    true = random_rig(3, published_rig())
    start = published_rig().model_copy(update={"emission": known_emission(true)})
    found = refine(start, surfaces(true, 3e-4), weight=PUBLISHED_WEIGHT)
    _, emission, _ = refined_curves(start, found)
    for new, old in zip(emission, true.emission, strict=True):
        ratio = np.array(new.values).sum() / old.at(FINE_NM).sum()
        assert np.abs(np.array(new.values) / ratio - old.at(FINE_NM)).max() < 0.02 * max(old.values)


@pytest.mark.slow
def test_an_unmeasured_emission_is_refined_too() -> None:
    true, nominal = random_rig(2, published_rig()), published_rig()
    data = surfaces(true, 3e-4)
    found = refine(nominal, data, weight=None)
    unchanged = found.deviation * 0
    before = residuals(nominal, data, type(found)(unchanged, found.covariance, 0.0, 0.0, 0.0, 0.0))
    after = residuals(nominal, data, found)
    assert np.sqrt((after**2).mean()) < 0.1 * np.sqrt((before**2).mean())


def test_whites_are_matched_exactly_and_once() -> None:
    true, nominal = random_rig(4, published_rig()), published_rig()
    model = SpectralModel(true)
    white = SurfaceSignals(
        np.zeros((1, 3, 3)),
        np.ones((1, 3, 3)),
        np.full((1, FINE_NM.size), 0.97),
        np.eye(3),
        np.zeros(1, bool),
    )
    signal = model.predict(np.zeros(model.size), white)[0][0]
    measured = WhiteSignals.model_validate(
        {"signal": signal.tolist(), "rel_std": [[1e-4] * 3] * 3, "white_over_sum": [1.0] * 3}
    )
    start = nominal.model_copy(update={"emission": true.emission})
    reflectance = SpectralCurve.of([400, 700], [0.97, 0.97])
    once = match_whites(start, measured, reflectance)
    again = match_whites(once, measured, reflectance)
    matched = SpectralModel(once).predict(np.zeros(model.size), white)[0][0]
    np.testing.assert_allclose(matched, signal, rtol=1e-9)
    assert again.white_scale == pytest.approx(once.white_scale, rel=1e-12)
    np.testing.assert_allclose(again.response[1].values, once.response[1].values, rtol=1e-9)
    errors = [np.sqrt((response_error(rig.response, true) ** 2).mean()) for rig in (start, once)]
    assert errors[1] < 0.7 * errors[0]


def test_a_leak_far_fainter_than_its_data_sheet_says_is_matched() -> None:
    rig, reflectance = published_rig(), SpectralCurve.of([400, 700], [0.97, 0.97])
    emission = np.stack([curve.at(FINE_NM) for curve in rig.emission]) * 0.97
    response = np.stack([curve.at(FINE_NM) for curve in rig.response])
    signal = rig.white_scale * response @ emission.T
    # A red filter with an edge: its data sheet has 23 times the light of the blue LED.
    signal[0] /= [0.95, 1.43, 22.8]
    measured = WhiteSignals.model_validate(
        {"signal": signal.tolist(), "rel_std": [[1e-4] * 3] * 3, "white_over_sum": [1.0] * 3}
    )
    found = match_whites(rig, measured, reflectance)
    matched = np.stack([curve.at(FINE_NM) for curve in found.response]) @ emission.T * found.white_scale
    np.testing.assert_allclose(matched, signal, rtol=1e-6)


def test_a_refinement_that_is_cancelled_ends_at_its_next_trial() -> None:
    rig, told = published_rig(), list[int]()
    token = CancelToken()

    def hear(stage: str, done: int, total: int) -> None:
        told.append(total)
        if done == 2:
            token.cancel()

    with pytest.raises(Cancelled, match=f"after 3 of {len(WEIGHTS)} steps"):
        refine(rig, surfaces(rig, 3e-4), None, 0.01, CallbackProgress(hear, token))
    assert len(told) == 3


NODES = np.arange(400.0, 701.0, 10.0)


def test_a_shift_of_a_curve_is_its_slope_where_it_is_a_fiftieth_of_its_peak() -> None:
    curve = np.exp(-(((FINE_NM - 550) / 30) ** 2))
    found = _basis(curve)
    assert found.shape == (32, 301)
    assert found[:31] == pytest.approx(np.stack([np.interp(FINE_NM, NODES, unit) for unit in np.eye(31)]))
    slope = np.gradient(curve)
    assert found[31] == pytest.approx(-slope / np.maximum(curve, 0.02))


def test_what_is_known_beforehand_is_gradients_levels_shifts_and_a_measured_emission() -> None:
    rig = published_rig()
    std = 0.05 * np.array(rig.emission[1].values) + 1e-6
    measured = rig.emission[1].model_copy(update={"std": tuple(std.tolist())})
    red, _, blue = (curve.model_copy(update={"std": None}) for curve in rig.emission)
    rig = rig.model_copy(update={"emission": (red, measured, blue)})
    found = _prior(rig, 0.005, 2e-4)
    gradient = np.diff(np.eye(31), axis=0)
    smooth = 0.005 / 2e-4 * gradient.T @ gradient + np.eye(31) / (31 * 0.3**2)
    wanted = np.zeros((193, 193))
    for k in range(6):
        part = slice(32 * k, 32 * k + 31)
        wanted[part, part] = smooth if k != 4 else np.diag(1 / _relative_std(measured) ** 2)
        wanted[32 * k + 31, 32 * k + 31] = 1 / 2.0**2 if k != 4 else 1 / 1e-3**2
    wanted[192, 192] = 1 / 0.02**2
    assert found == pytest.approx(wanted)


def test_a_measured_emission_is_known_to_a_thousandth_at_best_and_not_at_all_at_worst() -> None:
    curve = SpectralCurve.of(
        NODES, np.r_[np.full(30, 2.0), 0.0], std=np.r_[0.001, 0.1, np.full(28, 5.0), 1.0]
    )
    found = _relative_std(curve)
    assert found[:3] == pytest.approx([1e-3, 0.05, 1.0])
    assert found[-1] == 1.0


def test_a_datum_is_as_sure_as_its_noise_a_floor_and_the_chart() -> None:
    signal = np.array([[[10.0, 2.0]], [[5.0, 4.0]]])
    own = np.array([True, False])
    data = SurfaceSignals(signal, np.full(signal.shape, 0.01), np.ones((2, 301)), LIGHTS[:2], own)
    found = _total_std(data, 0.01)
    for surface, relative in enumerate((0.0002 + 0.01, 0.0002)):
        white = signal[surface].max()
        wanted = np.sqrt(0.01**2 + (relative * signal[surface]) ** 2 + (0.1 * relative * white) ** 2)
        assert found[surface] == pytest.approx(wanted)


def test_shapes_are_unsure_by_what_no_common_factor_does() -> None:
    """Against a covariance of one direction: a change of a node, and a common level, which shows nothing."""
    model, n = SpectralModel(published_rig()), 32
    direction = np.zeros(3 * n)
    direction[n + 12] = 0.1
    found = _shape_std(model.basis[:3], np.outer(direction, direction), model.response)
    change = np.zeros((3, FINE_NM.size))
    change[1] = 0.1 * model.basis[1, 12]
    common = (model.response * change).sum() / model.response.sum()
    assert found == pytest.approx(model.response * np.abs(change - common))
    level = np.concatenate([np.r_[np.ones(31), 0.0]] * 3)
    assert np.abs(_shape_std(model.basis[:3], np.outer(level, level), model.response)).max() < 1e-6
