"""White signals and the camera's evenness come out of uniform pictures with known truth."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.light.spectralon import UniformPictures, fit_evenness, measure_white
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import bayer_channels, gain_at_pixels

SHAPE = (96, 144)
Y, X = (axis / max(axis.max(), 1) * 2 - 1 for axis in np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float))
#: Vignetting: a fifth less light in the corners.
VIGNETTE = 1 - 0.1 * (X**2 + Y**2)
SIGNAL = np.array([[4.0, 1.0, 0.2], [1.0, 6.0, 1.5], [0.3, 1.0, 5.0]])
EVERY = np.ones(SHAPE, bool)


def pictures(gain: np.ndarray, noise: float = 2e-3, white: float = 1.0) -> UniformPictures:
    """Red, green, blue and white on a target whose shading falls to one side."""
    rng = np.random.default_rng(0)
    channel = bayer_channels("RGGB", *SHAPE)
    shading = 0.8 + 0.1 * X
    of_light = np.concatenate([SIGNAL.T, white * SIGNAL.sum(1)[None]])[:, channel]
    radiance = of_light * shading * gain * (1 + noise * rng.standard_normal((4, *SHAPE)))
    return UniformPictures(radiance, np.zeros(SHAPE, bool), shading, EVERY, Sensor(bayer="RGGB"))


def test_vignetting_is_found() -> None:
    truth = VIGNETTE / VIGNETTE.mean()
    found = fit_evenness(truth + 0.01 * np.random.default_rng(1).standard_normal(SHAPE), EVERY)
    error = gain_at_pixels(found.flat_field, *SHAPE) - truth
    assert np.sqrt(np.mean(error**2)) < 1e-3
    assert np.abs(error).max() < 6e-3
    assert found.residual == pytest.approx(0.01 / np.sqrt(VIGNETTE.size / (27 * 39)), rel=0.15)
    assert found.chi_square > 50


def test_an_even_camera_is_found_even_within_its_deviation() -> None:
    sigmas = []
    for seed in range(3):
        found = fit_evenness(1 + 0.01 * np.random.default_rng(seed).standard_normal(SHAPE), EVERY)
        sigmas.append((np.array(found.flat_field.gain) - 1) / np.array(found.std))
        assert found.chi_square == pytest.approx(1.0, abs=0.2)
    assert 0.5 < np.sqrt(np.mean(np.square(sigmas))) < 1.3


@pytest.mark.parametrize("noise", [0.002, 0.01])
def test_deviations_of_the_grid_hold_what_it_cannot_bend_to(noise: float) -> None:
    truth = VIGNETTE / VIGNETTE.mean()
    found = fit_evenness(truth + noise * np.random.default_rng(1).standard_normal(SHAPE), EVERY)
    stated = gain_at_pixels(found.flat_field.model_copy(update={"gain": found.std}), *SHAPE)
    sigmas = (gain_at_pixels(found.flat_field, *SHAPE) - truth) / stated
    assert 0.7 < np.sqrt(np.mean(sigmas**2)) < 1.1


def test_strong_vignetting_is_no_dirt() -> None:
    found = measure_white(pictures(1 - 0.25 * (X**2 + Y**2)))
    assert found.used.mean() > 0.99
    dirty = pictures(1 - 0.25 * (X**2 + Y**2))
    dirty.radiance[:, 20:30, 20:40] *= 0.7
    assert not measure_white(dirty).used[20:30, 20:40].any()


def test_white_signals_are_those_at_unit_shading_without_vignetting() -> None:
    found = measure_white(pictures(VIGNETTE))
    scale = found.white.array / SIGNAL
    # The gain has mean one, so that all signals are smaller by the mean of what the vignette leaves.
    assert scale == pytest.approx(np.full((3, 3), scale.mean()), rel=2e-3)
    assert scale.mean() == pytest.approx(VIGNETTE.mean(), rel=2e-3)
    assert found.white.white_over_sum == pytest.approx((1.0, 1.0, 1.0), abs=1e-3)
    assert np.max(found.white.rel_std) < 1e-3
    assert found.used.mean() > 0.99


def test_deviations_of_white_are_those_of_means_over_pixels() -> None:
    found = measure_white(pictures(np.ones(SHAPE)))
    pixels = np.array([1, 2, 1])[:, None] * VIGNETTE.size / 4
    assert np.mean(np.array(found.white.rel_std) * np.sqrt(pixels)) == pytest.approx(2e-3, rel=0.15)


def test_dirt_saturation_and_dark_borders_do_not_count() -> None:
    clean = pictures(np.ones(SHAPE))
    dirty = clean.radiance.copy()
    dirty[:, 20:30, 20:40] *= 0.5
    dirty[:, 60:70, 60:80] *= 0.95
    saturated = np.zeros(SHAPE, bool)
    saturated[60:70, 60:80] = True
    found = measure_white(
        UniformPictures(dirty, saturated, clean.shading, EVERY & (X > -0.9), Sensor(bayer="RGGB"))
    )
    assert not found.used[20:30, 20:40].any()
    assert not found.used[60:70, 60:80].any()
    assert not found.used[:, :5].any()
    assert found.white.array == pytest.approx(SIGNAL, rel=2e-3)


def test_white_that_is_not_the_sum_is_told() -> None:
    found = measure_white(pictures(np.ones(SHAPE), white=0.9))
    assert found.white.white_over_sum == pytest.approx((0.9, 0.9, 0.9), abs=1e-3)


def test_a_target_that_is_hardly_in_view_is_refused() -> None:
    seen = pictures(np.ones(SHAPE))
    little = EVERY & (X > 0.98)
    with pytest.raises(CalibrationError, match="pixels of the Spectralon are lit"):
        measure_white(UniformPictures(seen.radiance, seen.saturated, seen.shading, little, seen.sensor))
