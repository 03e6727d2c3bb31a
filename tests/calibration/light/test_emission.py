"""Emission from spectra with noise: unbiased, deviations honest, wrong spectra named."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.light.emission import measured_emission, smooth_curve
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.spectralon import COLOURS, EMISSION_SUM_NM, EmissionReadings, LightColour
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.published_rig import published_rig

NM = np.arange(400.0, 701.0)
WHITE = SpectralCurve.of([400, 700], [0.95, 0.99])
LIGHT: dict[LightColour, tuple[int, int, int]] = {
    "red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1), "white": (1, 1, 1), "black": (0, 0, 0),
}  # fmt: skip


def readings(noise: float = 0.002, count: int = 8, seed: int = 0) -> EmissionReadings:
    """Spectra as an instrument with noise would read them, other light of the room included."""
    rng = np.random.default_rng(seed)
    leds = np.stack([curve.at(NM) for curve in published_rig().emission]) * WHITE.at(NM)
    made: dict[LightColour, tuple[SpectralCurve, ...]] = {}
    for colour in COLOURS:
        value = np.array(LIGHT[colour]) @ leds + 0.01
        made[colour] = tuple(
            SpectralCurve.of(NM, 3e-3 * (value + noise * value.max() * rng.standard_normal(NM.size)))
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
