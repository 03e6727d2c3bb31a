"""Spectra of the scenes: ranges, features and metamerism."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.optics.colour import delta_e_2000, reflectance_to_lab
from dsl_core.simulation.scenes import materials
from dsl_core.simulation.scenes.truth import FINE_NM
from tests.cases.colour_science import colour_library


def at(spectrum: materials.Spectrum, wavelength_nm: float) -> float:
    return float(spectrum[np.searchsorted(FINE_NM, wavelength_nm)])


@pytest.mark.parametrize("centre", range(450, 651, 25))
@pytest.mark.parametrize("width", [10.0, 20.0])
def test_filter_has_its_width(centre: int, width: float) -> None:
    filter_ = materials.bandpass(centre, width)
    assert filter_.max() == pytest.approx(0.8)
    assert at(filter_, centre - width / 2) == pytest.approx(0.4)
    assert at(filter_, centre + width / 2) == pytest.approx(0.4)
    assert at(filter_, centre + 2 * width) < 0.001


def test_leaves_are_metamers() -> None:
    real, dyed = materials.leaf(), materials.dyed_leaf()
    difference = delta_e_2000(reflectance_to_lab(real, FINE_NM), reflectance_to_lab(dyed, FINE_NM))
    assert float(difference) < 1e-6
    inside = (FINE_NM >= 430) & (FINE_NM <= 660)
    assert np.sqrt(np.mean((real - dyed)[inside] ** 2)) > 0.04
    assert dyed.min() > 0


def test_leaf_colours_agree_by_colour_science_too() -> None:
    library = colour_library()
    shape = library.SpectralShape(400, 700, 1)
    observer = library.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    daylight = library.SDS_ILLUMINANTS["D65"].copy().align(shape)
    xyz = [
        library.sd_to_XYZ(library.SpectralDistribution(s, FINE_NM), observer, daylight, method="Integration")
        for s in (materials.leaf(), materials.dyed_leaf())
    ]
    # Its 400 to 700 nm leave out the ends, which weigh little: XYZ is on a scale of 100.
    np.testing.assert_allclose(xyz[0], xyz[1], atol=0.08)


def test_leaf_has_a_green_peak_and_a_red_edge() -> None:
    leaf = materials.leaf()
    visible = (FINE_NM > 480) & (FINE_NM < 660)
    assert FINE_NM[visible][leaf[visible].argmax()] == pytest.approx(550, abs=10)
    assert at(leaf, 675) < 0.5 * at(leaf, 550)
    assert at(leaf, 700) > 2 * at(leaf, 675)


def test_skin_shows_the_double_dip_of_haemoglobin() -> None:
    skin = materials.skin()
    assert at(skin, 542) < at(skin, 560)
    assert at(skin, 577) < at(skin, 560)
    assert at(skin, 620) > 1.2 * at(skin, 577)


def test_more_blood_reddens_and_more_melanin_darkens() -> None:
    assert at(materials.skin(blood=0.012), 577) < at(materials.skin(blood=0.004), 577)
    assert (materials.skin(melanin=0.1) < materials.skin(melanin=0.02)).all()


@pytest.mark.parametrize("name", ["BabelColor Average", "ISO 17321-1"])
def test_chart_passes_through_the_published_samples(name: str) -> None:
    samples = colour_library().SDS_COLOURCHECKERS[name]
    spectra = materials.chart_spectra(name)
    assert list(spectra) == list(samples)
    assert len(spectra) == 24
    for patch, spectrum in spectra.items():
        inside = (samples[patch].wavelengths >= 400) & (samples[patch].wavelengths <= 700)
        expected = samples[patch].values[inside]
        indices = np.searchsorted(FINE_NM, samples[patch].wavelengths[inside])
        np.testing.assert_allclose(spectrum[indices], expected, atol=1e-12)
