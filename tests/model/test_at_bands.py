from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import dsl_core as dsl
from dsl_core.errors import CalibrationError
from dsl_core.model.attributes import band_attributes, stated_band_width_nm
from dsl_core.model.result import build_result
from dsl_core.model.spectral import SpectralCurve, at_bands, band_weights

BANDS_NM = np.arange(430.0, 661.0, 5.0)
FINE_NM = np.arange(400.0, 700.5, 0.5)


def test_a_line_finer_than_a_band_keeps_its_area_and_is_no_peak_of_its_own_height() -> None:
    line = np.where(np.abs(FINE_NM - 547.5) < 0.6, 1.0, 0.0)
    found = at_bands(SpectralCurve.of(FINE_NM, line), BANDS_NM).values
    assert found.sum() * 5.0 == pytest.approx(np.trapezoid(line, FINE_NM), rel=0.02)
    # Plain interpolation would miss the line between two bands altogether.
    assert found.max() == pytest.approx(0.5 * np.trapezoid(line, FINE_NM) / 5.0, rel=0.05)
    assert np.interp(BANDS_NM, FINE_NM, line).max() == 0.0


def test_a_band_is_as_wide_as_it_says() -> None:
    weights = band_weights(FINE_NM, np.array([550.0]), np.array([5.0]))[0]
    assert weights.sum() == pytest.approx(1.0)
    assert np.sqrt(weights @ (FINE_NM - 550.0) ** 2) == pytest.approx(5 / np.sqrt(6), rel=0.06)


def test_coarse_samples_are_less_sure_between_them_and_stated_deviations_are_kept() -> None:
    nm = np.arange(400.0, 701.0, 20.0)
    values = 0.3 + 0.2 * np.sin(nm / 25)
    found = at_bands(SpectralCurve.of(nm, values), BANDS_NM)
    at, between = BANDS_NM % 20 == 0, BANDS_NM % 20 == 10
    assert found.std[at].max() < 1e-6 < found.std[between].mean()
    noisy = at_bands(SpectralCurve.of(FINE_NM, np.full(601, 0.5), std=np.full(601, 0.01)), BANDS_NM)
    # The sum of squares of a triangle's weights, ten samples wide at half height, is two thirds of a tenth.
    assert noisy.std == pytest.approx(0.01 * np.sqrt(2 / 3 / 10), rel=0.01)


@pytest.mark.parametrize("apart_nm", [5.0, 10.0])
def test_samples_as_coarse_as_bands_are_not_averaged_once_more(apart_nm: float) -> None:
    nm = np.arange(430.0, 661.0, apart_nm)
    curve = SpectralCurve.of(nm, 0.5 + 0.3 * np.sin(nm / 6), std=np.full(nm.size, 0.01))
    found = at_bands(curve, BANDS_NM, 5.0)
    at = np.isin(BANDS_NM, nm)
    assert found.values[at] == pytest.approx(np.asarray(curve.values), abs=1e-4)
    assert found.std[at] == pytest.approx(0.01, rel=0.01)


def test_what_a_spectrum_does_not_cover_is_not_made_up() -> None:
    with pytest.raises(CalibrationError, match="500 to 600 nm; the bands from 430 to 660"):
        at_bands(SpectralCurve.of([500.0, 600.0], [0.1, 0.2]), BANDS_NM)


@pytest.mark.parametrize(("beyond_nm", "covers"), [(2.4, True), (2.7, False)])
def test_a_spectrum_may_end_half_a_width_from_the_middle_of_a_band(beyond_nm: float, covers: bool) -> None:
    nm = np.linspace(BANDS_NM[0] + beyond_nm, BANDS_NM[-1], 500)
    curve = SpectralCurve.of(nm, 0.2 + 0.001 * (nm - 430))
    if covers:
        assert at_bands(curve, BANDS_NM, 5.0).values[:2] == pytest.approx([0.2, 0.205], abs=0.005)
    else:
        with pytest.raises(CalibrationError, match="It covers"):
            at_bands(curve, BANDS_NM, 5.0)


def test_bands_that_were_picked_are_as_wide_as_they_were_reconstructed() -> None:
    edge = SpectralCurve.of(FINE_NM, np.where(FINE_NM > 590, 0.6, 0.05))
    whole = at_bands(edge, BANDS_NM).values
    every_third, other_third = np.arange(0, len(BANDS_NM), 3), np.arange(2, len(BANDS_NM), 3)
    tenth, cut, pair = np.arange(0, len(BANDS_NM), 10), np.r_[0:14, 23:47], np.array([1, 4])
    for picked in (tenth, cut, np.array([33]), pair, every_third, other_third):
        nm = BANDS_NM[picked]
        width_nm = stated_band_width_nm(band_attributes(BANDS_NM), nm)
        found = at_bands(edge, nm, width_nm)
        np.testing.assert_allclose(found.values, whole[picked], atol=1e-6)


@pytest.mark.parametrize("count", [2, 3, 4, 5])
@pytest.mark.parametrize("bands_nm", [BANDS_NM, BANDS_NM[::-1]])
def test_means_of_bands_are_not_as_narrow_as_these(bands_nm: NDArray[np.float64], count: int) -> None:
    means_nm = bands_nm[: len(bands_nm) // count * count].reshape(-1, count).mean(1)
    assert stated_band_width_nm(band_attributes(bands_nm), means_nm) is None


def test_a_result_says_how_wide_its_bands_are_whatever_is_picked_of_it(tmp_path: Path) -> None:
    lines = (f"{nm:g},{0.6 if nm > 590 else 0.05}\n" for nm in np.arange(400, 701, 1))
    (tmp_path / "edge.csv").write_text("nm,red edge (1)\n" + "".join(lines))
    rising = np.where(BANDS_NM > 591, 0.6, np.where(BANDS_NM < 589, 0.05, 0.325))
    cube = np.broadcast_to(rising[:, None, None], (len(BANDS_NM), 2, 2)).astype(np.float32)
    arrays: dict[str, NDArray[Any]] = {"reflectance": cube, "flags": np.zeros((2, 2), np.uint16)}
    result = build_result(arrays, BANDS_NM, {}).sel(wavelength_nm=np.arange(450.0, 651.0, 50.0))
    saved = dsl.load_result(dsl.save_result(result, tmp_path / "a.zarr"))
    found = dsl.classify(saved, library=tmp_path / "edge.csv", measure="rmse", worst=0.01)
    assert float(found["fit"].max()) < 0.001


@pytest.mark.parametrize(
    "stated", [{}, {"band_width_nm": "wide"}, {"band_width_nm": -5.0, "first_band_nm": 430.0}]
)
def test_widths_that_nobody_states_are_the_distance_of_bands(stated: dict[str, object]) -> None:
    assert stated_band_width_nm(stated, BANDS_NM) is None
    assert band_attributes([430.0, 435.0, 450.0]) == band_attributes([430.0]) == {}
