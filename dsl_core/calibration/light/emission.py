"""Emission of the LEDs from a spectroradiometer that looks at a white standard.

Red, green, blue and white pictures minus black give four spectra of three unknowns; where they agree on red +
green + blue = white, all four count by their noise. Shin et al. (CVPR 2024, supplement), section 3.1: divided
by the reflectance of the Spectralon.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.light.emission_checks import require_repeats, white_of_parts
from dsl_core.calibration.light.emission_noise import noise_of_single
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.spectralon import (
    COLOURS,
    EMISSION_SUM_NM,
    EmissionReadings,
    LightColour,
    MeasuredEmission,
)
from dsl_core.model.spectral import SpectralCurve
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: Share by which white may differ from red + green + blue and still be used for the LEDs.
ADDITIVE = 0.01
#: Wavelengths (samples) over which the noise of repeated readings is pooled.
POOLED = 31
#: Red, green and blue must each lead where they should: their centroids rise from blue to red.
_LEDS: tuple[LightColour, ...] = ("red", "green", "blue")
#: Correlation lengths (nm) and scales that are tried.
LENGTHS_NM = np.geomspace(5.0, 160.0, 14)
SCALES = (0.5, 1.0, 2.0, 4.0)
#: Steps in which a curve is told where values are farther apart, and the largest step of values that tells
#: the peak of an LED, nm.
FINE_NM, MOST_STEP_NM = 1.0, 10.0
#: Share of the strongest light from which a wavelength belongs to an LED.
LIT_SHARE = 0.02
#: Half width (nm) of the envelope's maximum and blur, and its least value as a share of the peak.
ENVELOPE_NM, ENVELOPE_FLOOR = 6.0, 1e-3


def measured_emission(readings: EmissionReadings, reflectance: SpectralCurve) -> MeasuredEmission:
    """Emission with deviations; raises `CalibrationError` naming the picture whose spectrum is wrong."""
    missing = [colour for colour in COLOURS if not readings.readings.get(colour)]
    if missing:
        raise CalibrationError(
            f"The spectrum under {' and '.join(missing)} is missing. Measure all of {', '.join(COLOURS)}."
        )
    nm = np.array(readings.readings["white"][0].wavelengths_nm)
    require_repeats(readings)
    mean, variance = _means(readings, nm)
    _require_fine_steps(nm, mean)
    leds = np.stack([mean[c] - mean["black"] for c in _LEDS]) / reflectance.at(nm)
    white = (mean["white"] - mean["black"]) / reflectance.at(nm)
    noise = {c: variance[c] / reflectance.at(nm) ** 2 for c in COLOURS}
    _check_leds(nm, leds)
    step = np.gradient(nm)
    total = float((leds.sum(0) * step).sum())
    additivity = float((white * step).sum()) / total
    # White minus the sum of the three contains black twice.
    miss = noise["white"] + sum(noise[c] for c in _LEDS) + 4 * noise["black"]
    additivity_std = float(np.sqrt((miss * step**2).sum())) / total
    parts, apart = white_of_parts(white, leds, np.sqrt(miss))
    # Only from here on: spectra that do not agree must not excuse themselves by it.
    single = [c for c in COLOURS if len(readings.readings[c]) == 1]
    variance = noise_of_single(nm, mean, variance, parts, single)
    noise = {c: variance[c] / reflectance.at(nm) ** 2 for c in COLOURS}
    spread = np.stack([noise[c] + noise["black"] for c in _LEDS])
    if abs(additivity - 1) < ADDITIVE:
        leds, spread = _with_white(leds, white, spread, noise)
    found = _smoothed(
        nm, leds, np.sqrt(spread), (additivity, additivity_std), len(readings.readings["white"])
    )
    return found.model_copy(update={"white_parts": parts, "white_apart": apart})


def _require_fine_steps(nm: Floats, mean: dict[LightColour, Floats]) -> None:
    """Raise `CalibrationError` for steps in which peaks of the light of LEDs may go unseen."""
    light = np.max([mean[colour] - mean["black"] for colour in COLOURS], axis=0)
    is_lit = light > LIT_SHARE * light.max()
    steps = np.diff(nm)[is_lit[1:] | is_lit[:-1]]
    if steps.size and steps.max() > 1.01 * MOST_STEP_NM:
        raise CalibrationError(
            f"The spectra have values up to {steps.max():g} nm apart, which is too coarse for the peaks"
            f" of LEDs. Export them from the instrument every {MOST_STEP_NM:g} nm or finer."
        )


def _means(
    readings: EmissionReadings, nm: Floats
) -> tuple[dict[LightColour, Floats], dict[LightColour, Floats]]:
    """Mean of the repeats on one grid, and the variance of that mean."""
    mean, variance = {}, {}
    for colour in COLOURS:
        stack = np.stack([curve.at(nm) for curve in readings.readings[colour]])
        mean[colour], variance[colour] = stack.mean(0), _variance(stack) / len(stack)
    return mean, variance


def _variance(stack: Floats) -> Floats:
    """Variance of one reading (wavelengths,): scatter of repeats pooled over neighbours, else roughness."""
    from scipy.ndimage import uniform_filter1d

    if len(stack) > 1:
        return np.asarray(uniform_filter1d(stack.var(0, ddof=1), POOLED, mode="reflect"))
    # A single reading: second differences see its noise and little of a smooth spectrum.
    rough = robust_std(np.diff(stack[0], 2))
    return np.full(stack.shape[1], rough**2 / 6)


def _with_white(
    leds: Floats, white: Floats, spread: Floats, noise: dict[LightColour, Floats]
) -> tuple[Floats, Floats]:
    """Least squares update of the LEDs by white = red + green + blue, per wavelength."""
    black = noise["black"]
    covariance = black + np.eye(3)[:, :, None] * np.stack([noise[c] for c in _LEDS])
    with_sum = covariance.sum(1) - black  # of each LED with white minus the sum, up to sign
    innovation = covariance.sum((0, 1)) + noise["white"] + black - 6 * black
    gain = with_sum / np.maximum(innovation, 1e-300)
    better = leds + gain * (white - leds.sum(0))
    return better, np.maximum(spread - gain * with_sum, 0.1 * spread)


def _smoothed(
    nm: Floats, leds: Floats, std: Floats, additivity: tuple[float, float], count: int
) -> MeasuredEmission:
    # Between values that are far apart a curve is no straight line.
    coarse = float(np.diff(nm).max()) > 1.01 * FINE_NM
    fine = np.linspace(nm[0], nm[-1], 1 + math.ceil((nm[-1] - nm[0]) / FINE_NM)) if coarse else nm
    smooth = [smooth_curve(nm, value, noise, fine) for value, noise in zip(leds, std, strict=True)]
    scale = EMISSION_SUM_NM / float((sum(s.values for s in smooth) * np.gradient(fine)).sum())
    # Negative emission does not exist; what noise leaves below zero is far within its deviation.
    red, green, blue = (SpectralCurve.of(fine, (scale * s.values).clip(0), std=scale * s.std) for s in smooth)
    ends = max(max(curve.values[0], curve.values[-1]) / max(curve.values) for curve in (red, green, blue))
    first, second, third = (s.length_nm for s in smooth)
    return MeasuredEmission(
        curves=(red, green, blue),
        smoothing_nm=(first, second, third),
        additivity=additivity[0],
        additivity_std=additivity[1],
        readings=count,
        end_share=float(ends),
    )


def _check_leds(nm: Floats, leds: Floats) -> None:
    """Raise `CalibrationError` for a dark LED or swapped spectra."""
    power = (leds * np.gradient(nm)).sum(1)
    for colour, value in zip(_LEDS, power, strict=True):
        if not value > 1e-3 * power.max():
            raise CalibrationError(
                f"Under {colour} the Spectralon is hardly brighter than under black. Check that the projector"
                " shows the picture, that the instrument is aimed at the Spectralon, and its unit."
            )
    centre = (leds * nm * np.gradient(nm)).sum(1) / power
    if not centre[0] > centre[1] > centre[2]:
        found = ", ".join(f"{c} {value:.0f} nm" for c, value in zip(_LEDS, centre, strict=True))
        raise CalibrationError(
            f"The mean wavelengths of the LEDs are out of order ({found}). Spectra are swapped: name each"
            " after the picture it was measured under."
        )


@dataclass(frozen=True)
class SmoothCurve:
    """A smoothed curve with its deviation, both of shape (wavelengths,), and the length chosen (nm)."""

    values: Floats
    std: Floats
    length_nm: float


def smooth_curve(
    wavelengths_nm: Floats, values: Floats, std: Floats, at_nm: Floats | None = None
) -> SmoothCurve:
    """The most likely smooth curve behind values with independent noise of known deviation.

    All of shape (wavelengths,); values in any unit. The curve is that at other wavelengths ``at_nm`` if they
    are given: between values it is as unsure as they leave it. Not clipped at zero: that would bias dark
    wings.
    """
    from scipy.linalg import cho_solve

    peak = float(np.abs(values).max()) or 1.0
    y, noise = values / peak, np.maximum(std / peak, 1e-9)
    envelope = _envelope(wavelengths_nm, y, noise)
    distance = np.abs(wavelengths_nm[:, None] - wavelengths_nm)
    best = (-np.inf, 0.0, 1.0)
    for length in LENGTHS_NM:
        shape = _matern(distance / length) * np.outer(envelope, envelope)
        for scale in SCALES:
            # numpy's lets other threads run meanwhile, scipy's does not; with one right side that is brief.
            factor = np.linalg.cholesky(scale**2 * shape + np.diag(noise**2)), True
            evidence = -0.5 * y @ cho_solve(factor, y) - np.log(np.diag(factor[0])).sum()
            if evidence > best[0]:
                best = (float(evidence), float(length), scale)
    _, length_nm, scale = best
    at = wavelengths_nm if at_nm is None else at_nm
    at_envelope = np.interp(at, wavelengths_nm, envelope)
    prior, across = (
        scale**2 * _matern(np.abs(each[:, None] - wavelengths_nm) / length_nm) * np.outer(size, envelope)
        for each, size in ((wavelengths_nm, envelope), (at, at_envelope))
    )
    solved = np.linalg.solve(prior + np.diag(noise**2), np.column_stack([y, across.T]))
    mean = across @ solved[:, 0]
    spread = (scale * at_envelope) ** 2 - np.einsum("ij,ji->i", across, solved[:, 1:])
    return SmoothCurve(mean * peak, np.sqrt(np.maximum(spread, 0)) * peak, length_nm)


def _matern(distance: Floats) -> Floats:
    """Matern correlation of smoothness 3/2 at a distance in units of its length."""
    d = np.sqrt(3.0) * distance
    return np.asarray((1 + d) * np.exp(-d))


def _envelope(wavelengths_nm: Floats, values: Floats, noise: Floats) -> Floats:
    """How large the curve is around each wavelength, never below the noise or a share of its peak."""
    from scipy.ndimage import gaussian_filter1d, maximum_filter1d

    width = max(ENVELOPE_NM / float(np.median(np.diff(wavelengths_nm))), 1.0)
    blurred = gaussian_filter1d(values, width / 2, mode="nearest")
    largest = maximum_filter1d(np.abs(blurred), 2 * round(width) + 1, mode="nearest")
    least = np.maximum(ENVELOPE_FLOOR, noise / np.sqrt(width))
    return np.asarray(np.maximum(gaussian_filter1d(largest, width, mode="nearest"), least))
