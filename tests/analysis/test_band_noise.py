import numpy as np

from dsl_core.analysis.band_noise import OWN_SHARE, band_correlation, correlation_of, usual_correlation
from tests.cases.chart_cube import NM, chart_cube


def test_the_correlation_of_bands_is_found_from_neighbouring_pixels() -> None:
    cube = chart_cube()
    found = band_correlation(cube.reflectance, cube.std, cube.flags == 0)
    assert found is not None
    # Two Gaussian kernels of 1.2 bands overlap by exp(-lag² / (4 · 1.2²)).
    lags = np.arange(6)
    expected = np.exp(-(lags**2) / (4 * 1.2**2)) * (1 - OWN_SHARE)
    expected[0] = 1.0
    measured = [np.mean(np.diag(found, int(lag))[3:-3]) for lag in lags]
    assert np.abs(measured - expected).max() < 0.04


def test_few_pixels_tell_nothing_and_what_is_usual_can_be_inverted() -> None:
    cube = chart_cube()
    assert band_correlation(cube.reflectance[:, :3, :8], cube.std[:, :3, :8], cube.flags[:3, :8] == 0) is None
    for bands_nm in (np.arange(3) * 5.0, np.arange(430, 661, 5.0), np.arange(430, 661, 2.5)):
        usual = usual_correlation(bands_nm)
        assert np.linalg.eigvalsh(usual)[0] >= OWN_SHARE * 0.99
        assert np.allclose(np.diag(usual), 1)


def test_pixels_without_noise_of_their_own_tell_nothing() -> None:
    """Their errors are in common, or deviations are stated of a cube that was made without noise."""
    cube = chart_cube()
    still = np.moveaxis(cube.spectra[cube.material], -1, 0).astype(np.float32)
    assert band_correlation(still, cube.std, cube.flags == 0) is None
    np.testing.assert_array_equal(correlation_of(NM, still, cube.std, cube.flags), usual_correlation(NM))
    np.testing.assert_array_equal(correlation_of(NM, still, None), usual_correlation(NM))


def test_bands_that_no_pixel_has_leave_the_others_as_they_are() -> None:
    cube = chart_cube()
    gaps = cube.reflectance.copy()
    gaps[[4, 9]] = np.nan
    found, known = correlation_of(NM, gaps, cube.std, cube.flags), ~np.isin(np.arange(len(NM)), [4, 9])
    whole = correlation_of(NM, cube.reflectance, cube.std, cube.flags)
    np.testing.assert_allclose(found[np.ix_(known, known)], whole[np.ix_(known, known)], atol=0.05)
    assert np.isfinite(found).all()


def test_the_usual_correlation_goes_by_wavelength_and_not_by_number() -> None:
    wide, usual, fine = (usual_correlation(np.arange(430, 661, step)) for step in (10.0, 5.0, 2.5))
    # Every other band of a finer result, and one that lies between those of a wider one.
    np.testing.assert_allclose(usual[::2, ::2], wide, atol=0.01)
    np.testing.assert_allclose(fine[::2, ::2], usual, atol=0.01)
    assert usual[20, 21] < fine[40, 41] < 1 - OWN_SHARE
    # Where bands have been left out, those on both sides do not hang together as neighbours do.
    assert (
        usual_correlation([430.0, 435.0, 470.0])[1, 2] < 0.01 < 0.7 < usual_correlation([430.0, 435.0])[0, 1]
    )
