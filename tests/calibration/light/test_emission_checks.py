"""Spectra that look right one by one and do not fit each other are told."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.light.emission import measured_emission
from dsl_core.calibration.light.spectralon_figures import APART_PERCENT, PART_PERCENT
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.spectralon import EmissionReadings, LightColour, MeasuredEmission
from dsl_core.model.spectral import SpectralCurve

from .test_emission import WHITE, readings


def found(read: EmissionReadings) -> tuple[float, float]:
    """How far an LED is from its share of white, and white from its parts, both in %."""
    emission: MeasuredEmission = measured_emission(read, WHITE)
    assert emission.white_parts is not None
    assert emission.white_apart is not None
    return 100 * max(abs(part - 1) for part in emission.white_parts), 100 * emission.white_apart[0]


def shifted(read: EmissionReadings, off_nm: float, colours: tuple[LightColour, ...]) -> EmissionReadings:
    """An instrument whose wavelengths are off under some pictures."""
    changed = {
        colour: tuple(
            SpectralCurve.of(np.array(c.wavelengths_nm), c.at(np.array(c.wavelengths_nm) - off_nm))
            for c in read.readings[colour]
        )
        for colour in colours
    }
    return EmissionReadings(source="test", readings={**read.readings, **changed})


def test_sound_spectra_add_up_at_every_wavelength() -> None:
    part, apart = found(readings())
    assert part < 0.2 * PART_PERCENT
    assert apart < 0.3 * APART_PERCENT


def test_wavelengths_that_change_between_two_spectra_are_told() -> None:
    part, apart = found(shifted(readings(), 2.0, ("blue", "white")))
    assert part < PART_PERCENT  # their integrals are right
    assert apart > 2 * APART_PERCENT


def test_an_led_that_is_mixed_with_another_is_told() -> None:
    read = readings()
    mixed = tuple(
        SpectralCurve.of(np.array(g.wavelengths_nm), 0.9 * np.array(g.values) + 0.1 * np.array(r.values))
        for g, r in zip(read.readings["green"], read.readings["red"], strict=True)
    )
    part, apart = found(EmissionReadings(source="test", readings={**read.readings, "green": mixed}))
    assert part > PART_PERCENT
    assert apart < APART_PERCENT


@pytest.mark.parametrize("count", [1, 4])
def test_readings_of_other_light_than_most_of_their_picture_are_refused(count: int) -> None:
    read = readings(count=9)
    odd = (*read.readings["red"][:count], *read.readings["green"][count:])
    with pytest.raises(CalibrationError, match=f"{count} of 9 readings of green are of other light"):
        measured_emission(EmissionReadings(source="test", readings={**read.readings, "green": odd}), WHITE)


def test_noise_alone_makes_no_reading_odd() -> None:
    for noise in (0.002, 0.05):
        measured_emission(readings(noise=noise, count=16), WHITE)
