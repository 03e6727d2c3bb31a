"""Bandpass filters: the pass band of a data sheet, and what the chain sees through it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import (
    FINE_NM,
    nominal_filter,
    passed,
    passed_width_nm,
    relative_shift,
    shift_slopes,
    shift_terms,
    three_cavities,
    through_filter,
)
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.published_rig import published_rig


def test_a_nominal_filter_has_its_peak_and_half_of_it_half_a_width_away() -> None:
    curve = nominal_filter(550.0, fwhm_nm=12.0, peak=0.7)
    assert (curve.wavelengths_nm[0], curve.wavelengths_nm[-1]) == (490.0, 610.0)
    assert np.diff(curve.wavelengths_nm) == pytest.approx(0.5)
    at = curve.at(np.array([550.0, 544.0, 556.0, 538.0, 562.0]))
    assert at == pytest.approx([0.7, 0.35, 0.35, 0.7 / 65, 0.7 / 65])
    usual = nominal_filter(500.0)
    assert usual.at(np.array([500.0, 495.0, 505.0])) == pytest.approx([0.8, 0.4, 0.4])


@pytest.mark.parametrize("centre_nm", [450.0, 550.0, 640.0])
@pytest.mark.parametrize("fwhm_nm", [10.0, 20.0, 40.0])
def test_the_width_of_what_a_filter_passes_is_about_that_at_half_of_its_peak(
    centre_nm: float, fwhm_nm: float
) -> None:
    for peak in (0.3, 0.8):
        curve = nominal_filter(centre_nm, fwhm_nm, peak)
        assert passed_width_nm(published_rig(), curve) == pytest.approx(fwhm_nm, rel=0.06)
    assert passed_width_nm(published_rig(), nominal_filter(centre_nm, fwhm_nm, 0.0)) == 0.0


@pytest.mark.parametrize("peak", [0.2, 0.8])
def test_neither_the_near_infrared_nor_an_offset_makes_a_filter_broad(peak: float) -> None:
    nm = np.arange(350.0, 1101.0)
    narrow = three_cavities(nm - 550.0, 10.0, peak)
    for values in (narrow + 0.9 * (nm > 690), narrow + 0.005):
        curve = SpectralCurve.of(nm, values)
        assert passed_width_nm(published_rig(), curve) == pytest.approx(10.0, abs=1.5)


def test_light_through_a_filter_is_that_of_white_times_its_transmission_and_none_outside_it() -> None:
    rig, curve = published_rig(), nominal_filter(550.0)
    found = passed(rig, curve)
    white = chain_response(rig, 0, FINE_NM).sum(1)
    through = np.where(np.abs(FINE_NM - 550) <= 60, curve.at(FINE_NM), 0.0)
    assert (FINE_NM[0], FINE_NM[-1], FINE_NM.size) == (390.0, 710.0, 321)
    assert found == pytest.approx(white * through)
    flat = curve.model_copy(update={"values": (0.5,) * len(curve.values)})
    assert passed(rig, flat)[:, FINE_NM < 490].max() == 0.0
    assert passed(rig, flat)[:, FINE_NM > 610].max() == 0.0


def test_a_band_seen_at_angles_is_the_mean_of_bands_that_are_shifted() -> None:
    curve = nominal_filter(550.0)
    straight = through_filter(curve)
    assert straight == pytest.approx(np.where(np.abs(FINE_NM - 550) <= 60, curve.at(FINE_NM), 0.0))
    shift = np.array([0.0, -0.01])
    moved = np.interp(FINE_NM / 0.99, curve.wavelengths_nm, curve.values, 0.0, 0.0)
    assert FINE_NM[moved.argmax()] == pytest.approx(544.5, abs=1)
    assert through_filter(curve, shift) == pytest.approx((straight + moved) / 2)
    assert through_filter(curve, shift, np.array([1.0, 3.0])) == pytest.approx((straight + 3 * moved) / 4)
    assert through_filter(curve, shift, np.zeros(2)) == pytest.approx((straight + moved) / 2)
    rig = published_rig()
    assert passed(rig, curve, shift[1:]) == pytest.approx(chain_response(rig, 0, FINE_NM).sum(1) * moved)


@pytest.mark.parametrize("values", [(0.3, 0.02, -0.05), (0.02, 0.1, 0.03)])
def test_slopes_of_the_shift_are_its_derivatives(values: tuple[float, float, float]) -> None:
    """Also where the index is larger than that of any filter."""
    terms = np.random.default_rng(0).normal(0, 0.1, (5, 3))
    point, step = np.array(values), 1e-6
    numeric = np.stack(
        [
            (relative_shift(terms, point + change) - relative_shift(terms, point - change)) / (2 * step)
            for change in step * np.eye(3)
        ],
        axis=1,
    )
    np.testing.assert_allclose(shift_slopes(terms, point), numeric, atol=1e-7)


def test_a_filter_before_the_lens_passes_shorter_wavelengths_towards_every_corner() -> None:
    """Seen at an angle, the band of a layer of index n is at ``sqrt(1 - sin(angle)^2 / n^2)`` of itself."""
    rig, index = published_rig(), 2.0
    lens = rig.camera
    corners = [0, lens.width_px - 1, (lens.height_px - 1) * lens.width_px, lens.height_px * lens.width_px - 1]
    found = relative_shift(shift_terms(rig, np.array(corners)), np.array([index**-2, 0.0, 0.0]))
    for shift, at in zip(found, corners, strict=True):
        row, column = divmod(at, lens.width_px)
        ray = np.linalg.inv(lens.matrix) @ [column, row, 1.0]
        sine = math.sin(math.atan(math.hypot(ray[0], ray[1]) / ray[2]))
        # The lens distorts directions by up to 2 %, and shares of the band go with their squares.
        assert shift == pytest.approx(math.sqrt(1 - (sine / index) ** 2) - 1, rel=0.05)
