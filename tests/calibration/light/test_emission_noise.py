"""Single readings of spectra state the noise that they have where the LEDs are, and how alike it is."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.light.emission import measured_emission
from dsl_core.calibration.light.emission_noise import noise_of_single
from dsl_core.model.calibration.spectralon import COLOURS, EMISSION_SUM_NM, EmissionReadings, LightColour
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.published_rig import published_rig

NM = np.arange(380.0, 781.0, 2.0)
WHITE = SpectralCurve.of([400.0, 700.0], [1.0, 1.0])
#: What a triangle of 5 nm to both sides does to noise of 2 nm, and of how many wavelengths it is alike then.
TRIANGLE = np.array([0.5, 1.0, 0.5]) / np.sqrt(1.5)
ALIKE = 1 + 2 * (2 / 3 + 1 / 6)


def lights() -> dict[LightColour, np.ndarray]:
    red, green, blue = (
        curve.at(NM) * ((curve.wavelengths_nm[0] <= NM) & (curve.wavelengths_nm[-1] >= NM))
        for curve in published_rig().emission
    )
    return {"red": red, "green": green, "blue": blue, "white": red + green + blue, "black": 0 * red}


def deviation(kind: str, light: np.ndarray, peak: float) -> np.ndarray:
    """Of noise that is that of photons over a little, or the same everywhere."""
    if kind == "photons":
        return np.asarray(0.01 * np.sqrt(light * peak) + 2e-4 * peak)
    return np.full(len(NM), 0.003 * peak)


def drawn(kind: str, rng: np.random.Generator) -> dict[LightColour, np.ndarray]:
    peak = float(lights()["white"].max())
    noisy: dict[LightColour, np.ndarray] = {}
    for colour, light in lights().items():
        noise = rng.standard_normal(len(NM))
        if kind == "blurred":
            noise = np.convolve(noise, TRIANGLE, "same")
        noisy[colour] = light + deviation(kind, light, peak) * noise
    return noisy


def readings(spectra: dict[LightColour, np.ndarray]) -> EmissionReadings:
    """One reading of each."""
    return EmissionReadings(
        source="test", readings={c: (SpectralCurve.of(NM, v),) for c, v in spectra.items()}
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["even", "photons", "blurred"])
def test_emission_of_single_readings_is_right_within_its_deviation(kind: str) -> None:
    leds = [lights()[colour] for colour in ("red", "green", "blue")]
    scale = EMISSION_SUM_NM / float((np.sum(leds, 0) * np.gradient(NM)).sum())
    sigmas, stated = [], []
    for seed in range(4):
        found = measured_emission(readings(drawn(kind, np.random.default_rng(seed))), WHITE)
        for led, curve in zip(leds, found.curves, strict=True):
            lit = led > 0.1 * led.max()
            assert curve.std is not None
            # Curves are told in finer steps than these readings have.
            std = np.interp(NM, curve.wavelengths_nm, curve.std)[lit]
            sigmas.append((curve.at(NM)[lit] - scale * led[lit]) / std)
            stated.append(std / (scale * led.max()))
    assert 0.9 < np.mean(np.abs(np.concatenate(sigmas)) < 1.96) < 0.998
    assert np.sqrt(np.mean(np.concatenate(stated) ** 2)) < 0.007


@pytest.mark.parametrize("kind", ["even", "photons", "blurred"])
def test_variance_is_that_of_the_noise_times_the_wavelengths_at_which_it_is_alike(kind: str) -> None:
    peak, single = float(lights()["white"].max()), list(COLOURS)
    wanted = {c: deviation(kind, light, peak) ** 2 for c, light in lights().items()}
    ratios = []
    for seed in range(20):
        mean = drawn(kind, np.random.default_rng(seed))
        # As second differences see it in the dark.
        dark = {c: np.full(len(NM), v.min() * (1 / 6 if kind == "blurred" else 1)) for c, v in wanted.items()}
        found = noise_of_single(NM, mean, dark, (1.0, 1.0, 1.0), single)
        ratios.append([np.mean(found[c] / wanted[c]) for c in ("red", "green", "blue", "white")])
    assert np.median(ratios) == pytest.approx(ALIKE if kind == "blurred" else 1.0, rel=0.25)


def test_spectra_that_were_read_repeatedly_keep_their_variance() -> None:
    mean = drawn("photons", np.random.default_rng(0))
    stated = {c: np.full(len(NM), 1e-6) for c in COLOURS}
    found = noise_of_single(NM, mean, stated, (1.0, 1.0, 1.0), ["red"])
    assert [c for c in COLOURS if found[c] is not stated[c]] == ["red"]
    assert noise_of_single(NM, mean, stated, (1.0, 1.0, 1.0), []) == stated


def test_noise_is_never_less_than_the_roughness_says() -> None:
    mean = {c: light.copy() for c, light in lights().items()}
    stated = {c: np.full(len(NM), 1e-4) for c in COLOURS}
    found = noise_of_single(NM, mean, stated, (1.0, 1.0, 1.0), list(COLOURS))
    for colour in COLOURS:
        assert (found[colour] >= stated[colour]).all()


def test_a_white_that_is_not_its_parts_does_not_excuse_itself() -> None:
    """The deviations by which white is compared with red, green and blue are those of the roughness."""
    exact, noisy = lights(), drawn("even", np.random.default_rng(0))
    shifted = {**noisy, "white": noisy["white"] + 0.05 * np.gradient(exact["white"], NM) * 30}
    before, after = (measured_emission(readings(spectra), WHITE).white_apart for spectra in (noisy, shifted))
    assert before is not None
    assert after is not None
    assert after[1] == pytest.approx(before[1], rel=0.1)
    assert after[0] > 2 * before[0]
