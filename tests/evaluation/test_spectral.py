"""Spectral figures in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.analysis.band_noise import usual_correlation
from dsl_core.errors import DecodeError
from dsl_core.evaluation.spectral import compare, peak_width, spectral_errors
from dsl_core.model.spectral import SpectralCurve, at_bands

GRID = np.arange(430.0, 661.0, 5.0)
TRUTH = (0.5 + 0.3 * np.sin(GRID / 40))[:, None]


def bandpass(centre: float, width: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.asarray(0.8 / (1 + (2 * np.abs(GRID - centre) / width) ** 6))


def test_equal_spectra_have_no_error() -> None:
    errors = spectral_errors(TRUTH, TRUTH, GRID)
    for figure in (errors.rmse, errors.delta_e, errors.rmse_scaled, errors.delta_e_scaled):
        assert figure[0] == pytest.approx(0, abs=1e-9)
    assert errors.angle_rad[0] == pytest.approx(0, abs=1e-7)
    assert errors.scale[0] == pytest.approx(1)


def test_a_wrong_scale_is_an_error_only_without_free_scale() -> None:
    errors = spectral_errors(0.8 * TRUTH, TRUTH, GRID)
    assert errors.rmse[0] == pytest.approx(0.2 * np.sqrt(np.mean(TRUTH**2)))
    assert errors.delta_e[0] > 3
    assert errors.angle_rad[0] == pytest.approx(0, abs=1e-7)
    assert errors.scale[0] == pytest.approx(1.25)
    assert errors.rmse_scaled[0] == pytest.approx(0, abs=1e-12)
    assert errors.delta_e_scaled[0] == pytest.approx(0, abs=1e-9)


def test_angle_of_orthogonal_parts() -> None:
    measured = TRUTH.copy()
    other = np.zeros_like(TRUTH)
    other[0], other[1] = TRUTH[1], -TRUTH[0]
    measured += other * np.linalg.norm(TRUTH) / np.linalg.norm(other)
    assert spectral_errors(measured, TRUTH, GRID).angle_rad[0] == pytest.approx(np.pi / 4)


def test_a_black_measurement_is_at_right_angles() -> None:
    errors = spectral_errors(np.zeros_like(TRUTH), TRUTH, GRID)
    assert errors.angle_rad[0] == pytest.approx(np.pi / 2)
    assert errors.scale[0] == 1.0


def test_many_pixels_against_one_truth() -> None:
    noise = np.random.default_rng(0).normal(0, 0.02, (47, 2000))
    errors = spectral_errors(TRUTH + noise, TRUTH, GRID)
    assert errors.rmse.shape == (2000,)
    assert np.sqrt(np.mean(errors.rmse**2)) == pytest.approx(0.02, rel=0.01)


def test_shapes_and_nan_are_refused() -> None:
    with pytest.raises(DecodeError, match="47 bands"):
        spectral_errors(TRUTH[:40], TRUTH, GRID)
    with pytest.raises(DecodeError, match="finite"):
        spectral_errors(TRUTH * np.nan, TRUTH, GRID)


def test_width_of_a_triangle_is_exact() -> None:
    triangle = np.clip(1 - np.abs(GRID - 545) / 30, 0, None)
    peak = peak_width(GRID, triangle)
    assert peak.fwhm_nm == pytest.approx(30)
    assert peak.centre_nm == pytest.approx(545)
    assert peak.complete


def test_width_counts_from_the_baseline() -> None:
    triangle = 0.2 + np.clip(1 - np.abs(GRID - 545) / 30, 0, None)
    assert peak_width(GRID, triangle).fwhm_nm == pytest.approx(30)


@pytest.mark.parametrize("centre", range(450, 651, 25))
@pytest.mark.parametrize("width", [10.0, 15.0, 20.0])
def test_sampled_filters_keep_their_width(centre: int, width: float) -> None:
    peak = peak_width(GRID, bandpass(centre, width))
    assert peak.fwhm_nm == pytest.approx(width, abs=0.7)
    assert peak.centre_nm == pytest.approx(centre, abs=0.1)
    assert peak.height == pytest.approx(0.8)


def test_a_flank_beyond_the_bands_is_mirrored_and_said() -> None:
    peak = peak_width(GRID, bandpass(660, 20))
    assert not peak.complete
    assert peak.fwhm_nm == pytest.approx(20, abs=0.7)


def test_a_flat_curve_has_no_width() -> None:
    with pytest.raises(DecodeError, match="half"):
        peak_width(GRID, np.full(47, 0.4))


def test_a_reference_of_another_scale_differs_only_by_the_scale() -> None:
    truth = np.linspace(0.2, 0.8, GRID.size)
    reference = SpectralCurve.of(GRID, truth)
    found = compare(truth / 2, GRID, reference)
    assert found.scale == pytest.approx(2)
    assert found.angle_rad == pytest.approx(0, abs=1e-6)
    assert found.rmse > 0.2
    assert found.rmse_scaled == pytest.approx(0, abs=1e-9)
    assert found.delta_e_scaled < 1e-3 < found.delta_e


@pytest.mark.parametrize("step_nm", [5.0, 10.0, 20.0])
def test_a_reference_is_averaged_over_bands_as_the_spectrum_is(step_nm: float) -> None:
    fine = np.arange(400.0, 701.0)
    lines = SpectralCurve.of(fine, 0.9 - 0.5 * np.exp(-(((fine - 585) / 7) ** 2)), std=np.full(301, 0.01))
    bands = np.arange(430.0, 651.0, step_nm)
    exact = at_bands(lines, bands, step_nm)
    found = compare(exact.values, bands, lines)
    assert (found.rmse, found.delta_e) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert found.std is not None
    assert found.std.scale < 0.01 / np.sqrt(step_nm * 0.9)
    # Bands that were picked are as wide as before.
    some = compare(exact.values[::2], bands[::2], lines, width_nm=step_nm)
    assert some.rmse == pytest.approx(0.0, abs=1e-9)
    assert compare(exact.values[::2], bands[::2], lines).rmse > 0.001


def test_only_shared_bands_are_compared() -> None:
    found = compare(np.full(GRID.size, 0.5), GRID, SpectralCurve.of([500.0, 600.0], [0.5, 0.5]))
    assert (found.bands, found.range_nm) == (21, (500.0, 600.0))
    with pytest.raises(DecodeError, match="5 are needed"):
        compare(np.full(GRID.size, 0.5), GRID, SpectralCurve.of([700.0, 800.0], [0.5, 0.5]))


@pytest.mark.parametrize("offset", [0.0, 0.05])
@pytest.mark.parametrize("of_reference", [False, True])
def test_stated_deviations_are_those_of_figures_of_noisy_spectra(offset: float, of_reference: bool) -> None:
    lags = np.abs(np.subtract.outer(np.arange(len(GRID)), np.arange(len(GRID))))
    correlation, std = np.exp(-lags / 3.0), 0.01 + 0.005 * np.cos(GRID / 60)
    measured = TRUTH[:, 0] + offset * np.cos(GRID / 25)
    curve = SpectralCurve.of(GRID, TRUTH[:, 0])
    stated: NDArray[np.float64] | None = std
    if of_reference:
        stated, curve = None, curve.model_copy(update={"std": tuple(std)})
    found = compare(measured, GRID, curve, stated, correlation)
    noise = np.random.default_rng(3).multivariate_normal(
        np.zeros(len(GRID)), correlation * np.outer(std, std), 4000
    )
    first, second = measured[:, None], TRUTH
    drawn = (first, second + noise.T) if of_reference else (first + noise.T, second)
    drawn_measured, drawn_truth = np.broadcast_arrays(*drawn)
    errors = spectral_errors(drawn_measured, drawn_truth, GRID)
    assert found.std is not None
    for name in ("rmse", "angle_rad", "delta_e", "scale", "rmse_scaled", "delta_e_scaled"):
        off = np.sqrt(np.mean((getattr(errors, name) - getattr(found, name)) ** 2))
        # A scale that is off by chance moves the rest to second order only.
        assert getattr(found.std, name) == pytest.approx(off, rel=0.12), name


@pytest.mark.parametrize(("std", "offset"), [(0.005, 0.0), (0.02, 0.0), (0.005, 0.05)])
def test_figures_of_equal_spectra_are_what_noise_alone_makes(std: float, offset: float) -> None:
    curve, rng, correlation = (
        SpectralCurve.of(GRID, TRUTH[:, 0]),
        np.random.default_rng(8),
        usual_correlation(GRID),
    )
    shots = std * rng.multivariate_normal(np.zeros(GRID.size), correlation, 200) + TRUTH[:, 0]
    stated = np.full(GRID.size, std)
    equal = [compare(shot, GRID, curve, stated, correlation) for shot in shots]
    other = compare(TRUTH[:, 0] + offset * np.sin(GRID / 30), GRID, curve, stated, correlation)
    for name in ("rmse", "angle_rad", "delta_e", "rmse_scaled"):
        off = np.sqrt(np.mean([getattr(found, name) ** 2 for found in equal]))
        assert getattr(other.noise, name) == pytest.approx(off, rel=0.25), name
        assert getattr(equal[0].noise, name) == pytest.approx(off, rel=0.25), name


def test_a_comparison_without_stated_deviations_has_none() -> None:
    curve = SpectralCurve.of(GRID, TRUTH[:, 0])
    assert compare(0.9 * TRUTH[:, 0], GRID, curve).noise is None
    assert compare(0.9 * TRUTH[:, 0], GRID, curve).std is None
    assert compare(0.9 * TRUTH[:, 0], GRID, curve, np.full(len(GRID), np.nan)).std is None


def test_a_reference_of_few_wavelengths_has_no_colour_to_compare() -> None:
    nm = np.arange(430.0, 661.0, 5.0)
    whole = compare(np.full(47, 0.5), nm, SpectralCurve.of([400.0, 700.0], [0.4, 0.4]))
    part = compare(np.full(47, 0.5), nm, SpectralCurve.of([500.0, 550.0], [0.4, 0.4]))
    assert whole.delta_e > 1
    assert np.isnan([part.delta_e, part.delta_e_scaled]).all()
    assert part.rmse == pytest.approx(whole.rmse)
