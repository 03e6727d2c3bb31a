"""Spectra of one column find the wavelengths of their instrument, and say so where there are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.analysis.library import read_library
from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.catalogue import format_of, read_spectra
from dsl_core.io.spectra.formats import one_column

ASD = "splib07a_Wavelengths_ASD_0.35-2.5_microns_2151_ch.txt"
BECK = "splib07a_Wavelengths_BECK_Beckman_0.2-3.0_microns.txt"
NM = np.linspace(350.0, 800.0, 46)
SHARE = 0.2 + 0.3 * (NM - 350) / 450
DELETED = -1.23e34


def column(path: Path, header: str, values: np.ndarray) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f" {header}\n" + "".join(f" {value:.7e}\n" for value in values), "utf-8")
    return path


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A library as the USGS delivers it: wavelengths above the chapters, widths and deviations among them."""
    column(tmp_path / ASD, "splib07a Record=23: Wavelengths ASD 0.35-2.5 microns", NM / 1e3)
    column(tmp_path / "splib07a_Bandpass_(FWHM)_ASDFR.txt", "splib07a Record=24: Bandpass", NM / NM)
    column(
        tmp_path / "ChapterM_Minerals" / "splib07a_Kaolinite_CM5_ASDFRb_AREF.txt",
        "splib07a Record=5932: Kaolinite CM5                 ASDFRb AREF",
        np.where(NM < 375, DELETED, SHARE),
    )
    column(
        tmp_path / "ChapterM_Minerals/errorbars/errorbars_for_splib07a_Kaolinite_CM5_ASDFRb_AREF.txt",
        "splib07a Record=5933: error bars to record 5932",
        0.01 * SHARE,
    )
    return tmp_path


def test_wavelengths_are_found_above_and_deleted_channels_are_missing(library: Path) -> None:
    (found,) = read_spectra(library / "ChapterM_Minerals/splib07a_Kaolinite_CM5_ASDFRb_AREF.txt")
    assert (found.name, found.quantity, found.scaled) == ("Kaolinite CM5", "reflectance", True)
    np.testing.assert_allclose(found.nm, NM, rtol=1e-6)
    np.testing.assert_allclose(found.values, np.where(NM < 375, np.nan, SHARE), rtol=1e-6)


def test_a_library_has_the_spectra_alone(library: Path) -> None:
    read = read_library([library])
    assert [entry.name for entry in read.entries] == ["Kaolinite CM5"]
    assert read.notes == ()


def test_the_instrument_decides_between_axes_of_one_length(library: Path) -> None:
    column(library / BECK, "splib07a Record=1: Wavelengths BECK", NM / 1e3 + 0.01)
    beckman = column(library / "splib07a_Clay_BECKb_AREF.txt", "splib07a Record=7: Clay BECKb AREF", SHARE)
    (found,) = read_spectra(beckman)
    np.testing.assert_allclose(found.nm, NM + 10, rtol=1e-6)
    unknown = column(library / "clay.txt", "clay", SHARE)
    with pytest.raises(CalibrationError, match=r"clay\.txt has 46 values, and .*ASD.* and .*BECK.* as many"):
        read_spectra(unknown)


@pytest.mark.parametrize("header", ["splib07a Record=7: Clay ASDFRb AREF", "my leaf"])
def test_without_wavelengths_it_is_refused_with_what_to_do(tmp_path: Path, header: str) -> None:
    path = column(tmp_path / "clay.txt", header, SHARE)
    with pytest.raises(CalibrationError, match=r"no file near it has their wavelengths\. Put the one"):
        read_spectra(path)


def test_axes_in_nanometres_are_taken_as_they_are(tmp_path: Path) -> None:
    column(tmp_path / "wavelengths.txt", "nm", NM)
    (found,) = read_spectra(column(tmp_path / "leaf.txt", "leaf", SHARE))
    np.testing.assert_allclose(found.nm, NM, rtol=1e-6)
    assert found.quantity == "unstated"


def test_two_columns_are_not_taken_for_one(tmp_path: Path) -> None:
    path = tmp_path / "two.txt"
    path.write_text("nm R\n" + "".join(f"{nm} {r}\n" for nm, r in zip(NM, SHARE, strict=True)), "utf-8")
    assert format_of(path) is not one_column.FORMAT


def test_what_is_cut_off_in_its_midst_is_refused(library: Path) -> None:
    path = column(library / "long.txt", "long", np.full(6000, 0.5))
    with path.open("a", encoding="utf-8") as file:
        file.write("\nhalf a line\n")
    with pytest.raises(CalibrationError, match="line 6002 is not a number"):
        read_spectra(path)
