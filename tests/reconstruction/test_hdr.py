"""The merge is unbiased, knows its own noise, and says where it knows nothing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import ProjectorResponse, Sensor
from dsl_core.optics.sensor import digitise
from dsl_core.reconstruction.hdr import BlackFrame, HdrMerger, MergedFrame, black_frame, setting_gains_ms

SENSOR = Sensor(electrons_per_dn=4.0, read_noise_dn=1.5)
GAINS_MS = np.array([5.0, 107.0])
SHAPE = (70, 46)


def exact_black(offset_dn: float = 0.0, shape: tuple[int, int] = SHAPE) -> BlackFrame:
    level = np.full(shape, SENSOR.black_level_dn + offset_dn, np.float32)
    return BlackFrame(level, np.zeros(shape, np.float32))


def shoot(
    radiance: NDArray[np.float64], rng: np.random.Generator | None, offsets_dn: tuple[float, float] = (0, 0)
) -> list[NDArray[np.uint16]]:
    pairs = zip(GAINS_MS, offsets_dn, strict=True)
    return [digitise(SENSOR, (g * radiance + o).astype(np.float32), rng) for g, o in pairs]


def bias_and_chi2(level: float) -> tuple[float, float]:
    """Mean error in standard deviations, and mean square error over the variance claimed."""
    radiance = np.full((580, 200), level)
    black = exact_black(shape=radiance.shape)
    raws = shoot(radiance, np.random.default_rng(11))
    merged = HdrMerger(GAINS_MS, [black] * 2, SENSOR).merge(raws)
    assert not merged.saturated.any()
    error = (merged.radiance - level).astype(float)
    return float(error.mean() / np.sqrt(merged.variance.mean())), float((error**2 / merged.variance).mean())


@pytest.mark.parametrize("level", [0.0, 0.02, 0.3, 5.0, 30.0, 500.0])
def test_unbiased_and_as_uncertain_as_it_says(level: float) -> None:
    """From darkness to light that saturates the strong setting; 4 standard errors are 0.012 sigma."""
    bias, chi2 = bias_and_chi2(level)
    assert abs(bias) < 0.012
    # Exactly at black the positive half of the noise counts as signal: 10 % too careful.
    assert 0.87 < chi2 < 1.04


@pytest.mark.parametrize("level", [34.5, 35.0, 35.25])
def test_bias_at_the_edge_of_saturation_is_small(level: float) -> None:
    bias, chi2 = bias_and_chi2(level)
    assert abs(bias) < 0.15
    assert 0.85 < chi2 < 1.25


def by_trapezoids(raws: list[NDArray[np.uint16]]) -> NDArray[np.float64]:
    """Radiance by the published weights: up to 2 % above black, down from 85 to 97 % of scale."""
    full, signals = SENSOR.full_scale_dn, [raw - SENSOR.black_level_dn for raw in raws]
    weights = np.array(
        [
            np.clip(np.minimum(signal / (0.02 * full), (0.97 - raw / full) / 0.12), 0, 1)
            for raw, signal in zip(raws, signals, strict=True)
        ]
    )
    radiances = np.stack(signals) / GAINS_MS[:, None, None]
    return np.asarray((weights * radiances).sum(0) / weights.sum(0))


def test_inverse_variance_beats_either_setting_and_the_published_weights() -> None:
    rng = np.random.default_rng(2)
    radiance = np.full((580, 200), 3.0)
    raws = shoot(radiance, rng)
    black = exact_black(shape=radiance.shape)
    best = HdrMerger(GAINS_MS, [black] * 2, SENSOR).merge(raws)
    alone = HdrMerger(GAINS_MS[1:], [black], SENSOR).merge(raws[1:])
    assert np.var(best.radiance) < np.var(alone.radiance)
    assert np.var(best.radiance) < np.var(by_trapezoids(raws))


def test_black_keeps_its_sign_and_its_place() -> None:
    """Below black stays negative; each setting has its own black, pixel by pixel."""
    rng = np.random.default_rng(3)
    offsets = rng.uniform(0, 80, (2, *SHAPE)).astype(np.float32)
    blacks = [
        BlackFrame(np.round(SENSOR.black_level_dn + o), np.full(SHAPE, 0.1, np.float32)) for o in offsets
    ]
    dark = [(b.mean - 2).astype(np.uint16) for b in blacks]
    merged = HdrMerger(GAINS_MS, blacks, SENSOR).merge(dark)
    assert (merged.radiance < 0).all()
    same = HdrMerger(GAINS_MS, blacks, SENSOR).merge([b.mean.astype(np.uint16) for b in blacks])
    np.testing.assert_array_equal(same.radiance, 0)


def test_saturated_everywhere_is_a_bound_without_weight() -> None:
    radiance = np.ones(SHAPE)
    radiance[3, 4] = 1e6
    merger = HdrMerger(GAINS_MS, [exact_black()] * 2, SENSOR)
    merged = merger.merge(shoot(radiance, None))
    assert np.argwhere(merged.saturated).tolist() == [[3, 4]]
    assert np.isinf(merged.variance[3, 4])
    assert merged.radiance[3, 4] == pytest.approx((4095 * 0.98 - 260) / 5, rel=1e-3)
    assert np.isfinite(np.delete(merged.variance.ravel(), 3 * SHAPE[1] + 4)).all()


def test_saturation_margin_decides() -> None:
    radiance = np.full(SHAPE, 35.0)  # 4005 DN in the strong setting
    raws = shoot(radiance, None)
    used = HdrMerger(GAINS_MS, [exact_black()] * 2, SENSOR, saturation_margin_dn=80).merge(raws)
    dropped = HdrMerger(GAINS_MS, [exact_black()] * 2, SENSOR, saturation_margin_dn=100).merge(raws)
    assert dropped.variance.min() > 5 * used.variance.max()


def test_black_noise_is_carried_on() -> None:
    frames = [np.full(SHAPE, 300, np.uint16)] * 4
    black = black_frame(frames, SENSOR)
    np.testing.assert_allclose(black.variance, (1.5**2 + 1 / 12 + 40 / 4) / 4, rtol=1e-6)
    sure = HdrMerger(GAINS_MS, [exact_black(40)] * 2, SENSOR).merge([frames[0]] * 2)
    unsure = HdrMerger(GAINS_MS, [black] * 2, SENSOR).merge([frames[0]] * 2)
    np.testing.assert_allclose(unsure.variance / sure.variance, 1.25, rtol=1e-5)


def test_result_may_be_written_into_and_buffers_do_not_leak() -> None:
    merger = HdrMerger(GAINS_MS, [exact_black()] * 2, SENSOR)
    rng = np.random.default_rng(4)
    first, second = (shoot(rng.exponential(10.0, SHAPE), rng) for _ in range(2))
    kept = merger.merge(first)
    before = kept.radiance.copy()
    out = MergedFrame(*(np.empty(SHAPE, t) for t in (np.float32, np.float32, bool)))
    assert merger.merge(second, out) is out
    np.testing.assert_array_equal(kept.radiance, before)
    np.testing.assert_array_equal(
        out.radiance, HdrMerger(GAINS_MS, [exact_black()] * 2, SENSOR).merge(second).radiance
    )


@pytest.mark.parametrize("gain_ms", [1.0, 3e4])
def test_deviations_in_half_precision_are_those_of_numpy(gain_ms: float) -> None:
    """From infinity to below the least normal number, rounded to even as numpy does it."""
    rng = np.random.default_rng(6)
    raws = [rng.integers(200, 4200, SHAPE).astype(np.uint16) for _ in range(2)]
    gains = gain_ms * np.array([1.0, 20.0])
    merger = HdrMerger(gains, [exact_black()] * 2, SENSOR)
    wanted = merger.merge(raws)
    radiance = np.empty(SHAPE, np.float32)
    for kind in (np.float16, np.float32):
        std = np.empty(SHAPE, kind)
        merger.merge_std(raws, radiance, std)
        np.testing.assert_array_equal(std, np.sqrt(wanted.variance).astype(kind))
        np.testing.assert_array_equal(radiance, wanted.radiance)
    assert np.isinf(std).any()
    assert gain_ms == 1.0 or std.min() < np.finfo(np.float16).smallest_normal


def test_any_number_of_settings_and_levels_of_light() -> None:
    rng = np.random.default_rng(7)
    gains, levels = [5.0, 30.0, 107.0], [1.1, 0.9, 1.05]
    radiance = rng.uniform(1, 20, SHAPE)
    raws = [
        digitise(SENSOR, (g * level * radiance).astype(np.float32), None)
        for g, level in zip(gains, levels, strict=True)
    ]
    merged = HdrMerger(gains, [exact_black()] * 3, SENSOR).merge(raws, levels=levels)
    np.testing.assert_allclose(merged.radiance, radiance, atol=0.1)


def test_gains_of_the_published_settings() -> None:
    gains = setting_gains_ms(CapturePlan().settings, ProjectorResponse(gamma=2.21, black_fraction=0.01))
    assert gains[1] / gains[0] == pytest.approx(2 * 21.4, rel=0.01)
    assert gains[1] == pytest.approx(1000 / 3 * 0.99 * 0.8**2.21, rel=1e-6)


def test_wrong_input_is_refused() -> None:
    merger = HdrMerger(GAINS_MS, [exact_black()] * 2, SENSOR)
    raw = np.zeros(SHAPE, np.uint16)
    with pytest.raises(DecodeError, match="has 2 settings, given 1"):
        merger.merge([raw])
    with pytest.raises(DecodeError, match="is needed"):
        merger.merge([raw, raw[1:]])
    with pytest.raises(DecodeError, match="whole numbers"):
        merger.merge([raw, raw.astype(np.float32)])
    with pytest.raises(DecodeError, match="as many black"):
        HdrMerger(GAINS_MS, [exact_black()], SENSOR)
    with pytest.raises(DecodeError, match="positive"):
        HdrMerger([1.0, 0.0], [exact_black()] * 2, SENSOR)
    with pytest.raises(DecodeError, match="no black"):
        black_frame([], SENSOR)


def test_other_light_at_a_setting_is_another_gain() -> None:
    """Frames that were exposed to more or less light than their settings say, some of them saturated."""
    rng = np.random.default_rng(6)
    raws = shoot(rng.exponential(20.0, SHAPE), rng)
    raws[0][0, :2] = raws[1][0, :2] = SENSOR.full_scale_dn
    levels = [0.8, 1.3]
    found = HdrMerger(GAINS_MS, [exact_black()] * 2, SENSOR).merge(raws, levels=levels)
    wanted = HdrMerger(GAINS_MS * levels, [exact_black()] * 2, SENSOR).merge(raws)
    assert wanted.saturated.sum() == 2
    np.testing.assert_array_equal(found.saturated, wanted.saturated)
    np.testing.assert_allclose(found.radiance, wanted.radiance, rtol=1e-5)
    np.testing.assert_allclose(found.variance, wanted.variance, rtol=1e-5)
