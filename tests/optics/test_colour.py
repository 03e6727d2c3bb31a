"""Colours against colour-science and against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from dsl_core.optics import colour as ours
from dsl_core.optics.relighting import LIGHTS
from tests.cases.colour_science import colour_library

GRID = np.arange(430.0, 661.0, 5.0)
WIDE = np.arange(380.0, 781.0, 5.0)


@pytest.fixture(scope="module")
def library() -> Any:
    return colour_library()


def smooth_spectra(wavelengths: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Reflectances 0..1 made of a few waves, shape (bands, count)."""
    random = np.random.default_rng(5)
    phase, pace = random.uniform(0, 6, (1, count)), random.uniform(0.2, 1.5, (1, count))
    return np.asarray(0.5 + 0.45 * np.sin(pace * wavelengths[:, None] / 60 + phase))


def test_tables_equal_colour_science(library: Any) -> None:
    observer = library.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    daylight = library.SDS_ILLUMINANTS["D65"]
    np.testing.assert_allclose(ours.CIE_1931_XYZ.T, observer[ours.CIE_NM], rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(ours.CIE_D65, daylight[ours.CIE_NM], rtol=1e-5)


def test_tables_of_illuminants_and_charts_equal_colour_science(library: Any) -> None:
    for name, (nm, power) in ours.read_columns("colour/illuminants.csv").items():
        np.testing.assert_array_equal(nm, ours.CIE_NM)
        spectrum = library.SDS_ILLUMINANTS[name]
        np.testing.assert_allclose(power, np.interp(nm, spectrum.wavelengths, spectrum.values), rtol=1e-9)
    assert set(LIGHTS) <= {"D65", *ours.read_columns("colour/illuminants.csv")}


@pytest.mark.parametrize("illuminant", ["D65", "A", "D50"])
def test_xyz_equals_colour_science(library: Any, illuminant: str) -> None:
    cube = smooth_spectra(WIDE, 20)
    shape = library.SpectralShape(380, 780, 5)
    expected = library.msds_to_XYZ(
        cube.T,
        library.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape),
        library.SDS_ILLUMINANTS[illuminant].copy().align(shape),
        method="Integration",
        shape=shape,
    )
    actual = ours.reflectance_to_xyz(cube, WIDE, illuminant)
    np.testing.assert_allclose(actual.T, expected / 100, atol=6e-4)


def test_unknown_illuminant_names_the_known_ones() -> None:
    with pytest.raises(ValueError, match="D65"):
        ours.observer_weights(GRID, "candle")


def test_unsorted_bands_are_refused() -> None:
    with pytest.raises(ValueError, match="rising"):
        ours.observer_weights(GRID[::-1])


@pytest.mark.parametrize("bands", [GRID, WIDE, np.arange(450.0, 651.0, 50.0)])
def test_perfect_diffuser_is_white_on_every_grid(bands: NDArray[np.float64]) -> None:
    white = np.ones((bands.size, 2, 3), np.float32)
    xyz = ours.reflectance_to_xyz(white, bands)
    np.testing.assert_allclose(xyz[:, 0, 0], [0.95047, 1.0, 1.08883], atol=3e-4)
    np.testing.assert_allclose(ours.reflectance_to_srgb(white, bands), 1.0, atol=1e-3)


def test_truncated_grid_keeps_the_colour_of_spectra_that_end_flat() -> None:
    wide = 0.2 + 0.6 / (1 + np.exp(-(WIDE - 560) / 12))
    short = np.interp(GRID, WIDE, wide)
    np.testing.assert_allclose(
        ours.reflectance_to_lab(short, GRID), ours.reflectance_to_lab(wide, WIDE), atol=0.05
    )


def test_srgb_equals_colour_science(library: Any) -> None:
    random = np.random.default_rng(1)
    rgb = random.uniform(0.0, 1.0, (200, 3))
    xyz = library.sRGB_to_XYZ(rgb)
    expected = np.clip(library.XYZ_to_sRGB(xyz), 0, 1)
    np.testing.assert_allclose(ours.xyz_to_srgb(xyz.T), expected.T, atol=2e-4)


def test_srgb_clips_and_keeps_nan() -> None:
    cube = np.stack([np.full(GRID.size, v, np.float32) for v in (-1.0, 3.0, np.nan)], axis=1)
    rgb = ours.reflectance_to_srgb(cube, GRID)
    assert rgb.dtype == np.float32
    np.testing.assert_array_equal(rgb[:, 0], 0.0)
    np.testing.assert_allclose(rgb[:, 1], 1.0, atol=1e-6)
    assert np.isnan(rgb[:, 2]).all()


def test_lab_equals_colour_science(library: Any) -> None:
    random = np.random.default_rng(2)
    xyz = random.uniform(0.0005, 1.0, (3, 100))
    xyz[:, ::4] *= np.linspace(0.002, 0.02, 25)  # on both sides of where the straight line ends
    white = np.array([0.9504, 1.0, 1.0888])
    expected = library.XYZ_to_Lab(xyz.T, library.XYZ_to_xy(white))
    np.testing.assert_allclose(ours.xyz_to_lab(xyz, white).T, expected, atol=1e-6)


def test_delta_e_equals_colour_science(library: Any) -> None:
    random = np.random.default_rng(3)
    first = np.stack([random.uniform(0, 100, 3000), *random.uniform(-90, 90, (2, 3000))])
    second = first + random.normal(0, [[5], [20], [20]], first.shape)
    second[1:, :50] = 0.0  # greys have no hue
    expected = library.difference.delta_E_CIE2000(first.T, second.T)
    np.testing.assert_allclose(ours.delta_e_2000(first, second), expected, atol=1e-9)


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [  # Sharma et al. 2005, table 1: pairs 1, 7, 13, 17, 20, 34
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
        ((50, 0, 0), (50, -1, 2), 2.3669),
        ((50, -0.001, 2.49), (50, 0.0011, -2.49), 4.7461),
        ((50, 2.5, 0), (73, 25, -18), 27.1492),
        ((50, 2.5, 0), (58, 24, 15), 19.4535),
        ((2.0776, 0.0795, -1.135), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_delta_e_of_published_pairs(
    first: tuple[float, ...], second: tuple[float, ...], expected: float
) -> None:
    actual = ours.delta_e_2000(np.array(first, float), np.array(second, float))
    assert float(actual) == pytest.approx(expected, abs=1e-4)


def test_weights_sum_over_every_nanometre_of_the_tables() -> None:
    """One band of everything, and a hat in the last five nanometres, by the tables' own values there."""
    nm = np.arange(ours.CIE_NM[0], ours.CIE_NM[-1] + 0.5)
    power = np.interp(nm, ours.CIE_NM, ours.CIE_D65)
    matching = CubicSpline(ours.CIE_NM, ours.CIE_1931_XYZ, axis=1)(nm) * power
    found = ours.observer_weights(np.array([ours.CIE_NM[0], ours.CIE_NM[-2], ours.CIE_NM[-1]]))
    hat = np.clip((nm - ours.CIE_NM[-2]) / (ours.CIE_NM[-1] - ours.CIE_NM[-2]), 0, 1)
    assert found[:, 2] == pytest.approx(matching @ hat / matching[1].sum(), rel=1e-9)
    assert found.sum(1) == pytest.approx(matching.sum(1) / matching[1].sum())


def test_bands_may_be_close_together_but_not_equal() -> None:
    ours.observer_weights(np.arange(500.0, 520.0, 0.5))
    with pytest.raises(ValueError, match="rising"):
        ours.observer_weights(np.array([500.0, 500.0, 505.0]))
