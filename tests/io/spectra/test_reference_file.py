"""References from libraries that another program wrote, from tables of this one, and from text."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.export.spectra import NamedSpectrum, export_spectra
from dsl_core.io.spectra.reference_file import read_reference, read_references

NM = np.arange(400.0, 701.0, 10.0)
GRASS, BRICK = np.linspace(0.05, 0.4, NM.size), np.linspace(0.3, 0.6, NM.size)
HEADER = {
    "samples": NM.size,
    "lines": 2,
    "bands": 1,
    "header offset": 0,
    "file type": "ENVI Spectral Library",
    "data type": 4,
    "interleave": "bsq",
    "byte order": 0,
    "wavelength units": "Nanometers",
    "spectra names": "{Grass, Brick}",
    "wavelength": "{" + ",\n ".join(f"{nm:g}" for nm in NM) + "}",
}


def write_library(
    path: Path, fields: Mapping[str, object] | None = None, kind: str = "<f4", offset: int = 0
) -> Path:
    """A library as ENVI writes it, with some fields of the header replaced (None: left out)."""
    header = {**HEADER, **(fields or {})}
    lines = [f"{key} = {value}" for key, value in header.items() if value is not None]
    path.with_suffix(".hdr").write_text("\n".join(["ENVI", "description = {a = b, c}", *lines]), "utf-8")
    path.write_bytes(b"x" * offset + np.stack([GRASS, BRICK]).astype(kind).tobytes())
    return path


def test_a_library_of_the_spectral_package(tmp_path: Path) -> None:
    from spectral.io import envi

    header = {"wavelength": [str(nm / 1000) for nm in NM], "spectra names": ["Grass", "Grass"]}
    library = envi.SpectralLibrary(np.stack([GRASS, BRICK]), {**header, "wavelength units": "Micrometers"})
    library.save(str(tmp_path / "usgs"), "Two spectra")
    for path in (tmp_path / "usgs.sli", tmp_path / "usgs.hdr"):
        grass, brick = read_references(path).references
        assert (grass.name, brick.name) == ("Grass", "Grass (2)")
        np.testing.assert_allclose(grass.curve.wavelengths_nm, NM, rtol=1e-6)
        np.testing.assert_allclose(grass.curve.values, GRASS, rtol=1e-6)
        np.testing.assert_allclose(brick.curve.values, BRICK, rtol=1e-6)
    np.testing.assert_allclose(read_reference(tmp_path / "usgs.sli", "Grass (2)").values, BRICK, rtol=1e-6)
    with pytest.raises(CalibrationError, match="no spectrum 'Roof'"):
        read_reference(tmp_path / "usgs.sli", "Roof")


def test_byte_order_offset_scale_and_falling_wavelengths_are_understood(tmp_path: Path) -> None:
    path = write_library(
        tmp_path / "a.sli", {"data type": 5, "byte order": 1, "header offset": 12}, ">f8", 12
    )
    np.testing.assert_allclose(read_reference(path, "Brick").values, BRICK)
    falling = "{" + ",".join(f"{nm:g}" for nm in NM[::-1]) + "}"
    path = write_library(tmp_path / "b.sli", {"wavelength": falling, "wavelength units": None})
    np.testing.assert_allclose(read_reference(path, "Grass").values, GRASS[::-1], rtol=1e-6)
    path = write_library(tmp_path / "c.sli", {"reflectance scale factor": 10})
    np.testing.assert_allclose(read_reference(path, "Grass").values, GRASS / 10, rtol=1e-6)
    path = write_library(tmp_path / "d.sli", {"reflectance scale factor": 0.01})  # percent
    np.testing.assert_allclose(read_reference(path, "Grass").values, GRASS, rtol=1e-6)
    header = (tmp_path / "c.hdr").read_text("utf-8").replace("Grass", "Grün")
    (tmp_path / "c.hdr").write_bytes(header.replace("\n", "\r\n").encode("latin-1"))
    path = tmp_path / "c.sli"
    assert read_references(path).references[0].name == "Grün"


def test_a_library_cut_off_after_its_offset_is_told(tmp_path: Path) -> None:
    path = write_library(tmp_path / "a.sli", {"header offset": 12}, offset=12)
    path.write_bytes(path.read_bytes()[:-4])
    wanted = 2 * len(NM)
    with pytest.raises(CalibrationError, match=rf"are {wanted} values, but it contains {wanted - 1}\."):
        read_references(path)


def test_deleted_values_are_neither_shown_nor_bridged(tmp_path: Path) -> None:
    path = write_library(tmp_path / "a.sli", {"data ignore value": -1})
    values = np.stack([GRASS, BRICK]).astype("<f4")
    values[0, [0, 5, 24, 25, 26]] = -1.23e34, -1, -1, -1, -1
    values[1] = -1
    path.write_bytes(values.tobytes())
    found = read_references(path)
    assert found.empty == ("Brick",)
    np.testing.assert_array_equal(found.references[0].curve.wavelengths_nm, np.delete(NM[1:24], 4))
    values[0] = -1
    path.write_bytes(values.tobytes())
    with pytest.raises(CalibrationError, match=r"No spectrum of a\.sli"):
        read_references(path)


@pytest.mark.parametrize("ignored", [-9999.9, -99.99, -0.001, 1.23e36, 3.4028235e38])
def test_deleted_values_in_32_bits_are_those_of_a_decimal_header(tmp_path: Path, ignored: float) -> None:
    path = write_library(tmp_path / "a.sli", {"data ignore value": ignored})
    values = np.stack([GRASS, BRICK]).astype("<f4")
    values[0, -4:] = ignored
    path.write_bytes(values.tobytes())
    np.testing.assert_array_equal(read_reference(path, "Grass").wavelengths_nm, NM[:-4])
    np.testing.assert_array_equal(read_reference(path, "Brick").wavelengths_nm, NM)


@pytest.mark.parametrize("marker", [-9999.0, -999.0, -99.0])
@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_numbers_that_mark_deleted_values_are_no_reflectance(
    tmp_path: Path, marker: float, scale: float
) -> None:
    values = BRICK * scale
    values[[3, -1]] = marker
    path = tmp_path / "a.csv"
    rows = (f"{nm:g},{value:g}" for nm, value in zip(NM, values, strict=True))
    path.write_text("\n".join(["nm,reflectance", *rows]))
    found = read_references(path)
    curve = found.references[0].curve
    np.testing.assert_array_equal(curve.wavelengths_nm, np.delete(NM, [3, NM.size - 1]))
    np.testing.assert_allclose(curve.values, np.delete(BRICK, [3, NM.size - 1]), rtol=1e-5)
    assert found.notes == ("values below -0.9 are taken as deleted: 2.",)


def test_whole_numbers_over_a_scale_factor_mark_deleted_values_too(tmp_path: Path) -> None:
    path = write_library(tmp_path / "a.sli", {"data type": 2, "reflectance scale factor": 10000})
    values = (np.stack([GRASS, BRICK]) * 10000).astype("<i2")
    values[0, -1] = -9999
    path.write_bytes(values.tobytes())
    found = read_references(path)
    np.testing.assert_array_equal(found.references[0].curve.wavelengths_nm, NM[:-1])
    assert found.notes == ("values below -0.9 are taken as deleted: 1.",)


def test_noise_about_zero_of_a_dark_spectrum_in_percent_stays(tmp_path: Path) -> None:
    path = tmp_path / "two.csv"
    rows = (f"{nm},90,{-1.2 if nm == 400 else 1.5}" for nm in range(400, 701, 10))
    path.write_text("\n".join(["nm,white,black", *rows]))
    found = read_references(path)
    assert found.references[1].curve.values[:2] == pytest.approx((-0.012, 0.015))
    assert found.notes == ()


def test_noise_beyond_the_visible_says_nothing_of_the_scale_of_a_library(tmp_path: Path) -> None:
    nm = np.arange(350.0, 2501.0, 10.0)
    listed = {"wavelength": "{" + ",".join(f"{each:g}" for each in nm) + "}", "samples": nm.size}
    share = 0.3 + 0.1 * np.sin(nm / 200)
    noisy, percent = share.copy(), 100 * share
    noisy[-1] = 2.7
    # In percent, a cloth that is black where light is visible.
    percent[nm < 800] = 1.5
    bad = {"bbl": "{" + ",".join("0" if each > 2400 else "1" for each in nm) + "}"}
    for fields, values in (
        ({}, noisy),
        ({"reflectance scale factor": 10000}, noisy * 10000),
        (bad, np.where(nm > 2400, 5.0, share)),
        ({}, percent),
    ):
        path = write_library(tmp_path / "a.sli", {**listed, **fields})
        path.write_bytes(np.stack([values, values]).astype("<f4").tobytes())
        curve = read_reference(path, "Grass")
        wanted = percent * 0.01 if values is percent else share
        np.testing.assert_allclose(curve.values[:200], wanted[:200], rtol=1e-5)
        assert curve.wavelengths_nm[-1] == (2400 if fields is bad else 2500)


@pytest.mark.parametrize(
    ("marks", "told"),
    [
        ("{" + "0," * 31 + "}", "marks 0 of 31 bands as good"),
        ("{1, 0}", "marks 1 of 2 bands as good, for 31 bands"),
        ("{1, x}", "a mark of bbl is not a number"),
    ],
)
def test_marks_of_bad_bands_that_do_not_fit_are_told(tmp_path: Path, marks: str, told: str) -> None:
    with pytest.raises(CalibrationError, match=told):
        read_references(write_library(tmp_path / "a.sli", {"bbl": marks}))


@pytest.mark.parametrize(
    ("unit", "in_nm"),
    [
        *(("Nanometers", 1), ("nanometres", 1), ("nm", 1), ("Micrometers", 1000), ("micrometres", 1000)),
        *(("Nanometer", 1), ("nanometre", 1), ("Micrometer", 1000), ("micrometre", 1000), ("Micron", 1000)),
        *(("um", 1000), ("\u00b5m", 1000), ("\u03bcm", 1000), ("Microns", 1000)),
    ],
)
def test_wavelengths_are_read_in_any_unit_of_length_that_libraries_use(
    tmp_path: Path, unit: str, in_nm: int
) -> None:
    listed = "{" + ", ".join(f"{nm / in_nm:.6g}" for nm in NM) + "}"
    path = write_library(tmp_path / "a.sli", {"wavelength units": unit, "wavelength": listed})
    np.testing.assert_allclose(read_references(path).references[0].curve.wavelengths_nm, NM, rtol=1e-6)


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"file type": "ENVI Standard"}, "describes ENVI Standard, not an ENVI spectral library"),
        ({"wavelength": None}, "names 0 wavelengths for 31 bands"),
        ({"wavelength": "{400, x}"}, "a wavelength is not a number"),
        ({"wavelength units": "Wavenumber"}, "wavenumber; nanometres or micrometres are needed"),
        ({"wavelength": "{" + ",".join(["500"] * NM.size) + "}"}, "wavelengths occur twice"),
        ({"samples": None}, "'samples'; the header says 'nothing'"),
        ({"lines": 3}, "cut off: 3 spectra of 31 bands are 93 values, but it contains 62"),
        ({"data type": 6}, "data type = 6"),
        ({"bands": 4}, "bands = 4"),
        ({"reflectance scale factor": "0.001"}, "contains values up to 600; reflectance from 0 to 1"),
        ({"data ignore value": "none"}, "ignore value is not a number"),
    ],
)
def test_wrong_libraries_are_named_with_the_reason(
    tmp_path: Path, fields: dict[str, object], told: str
) -> None:
    path = write_library(tmp_path / "a.sli", fields)
    with pytest.raises(CalibrationError, match=told) as caught:
        read_references(path)
    assert "a." in str(caught.value)


def test_half_a_library_says_what_is_missing(tmp_path: Path) -> None:
    path = write_library(tmp_path / "a.sli")
    (tmp_path / "a.hdr").rename(tmp_path / "b.hdr")
    with pytest.raises(CalibrationError, match=r"Put a\.hdr next to it"):
        read_references(path)
    with pytest.raises(CalibrationError, match=r"Put b\.sli there"):
        read_references(tmp_path / "b.hdr")


def test_a_table_of_this_program_holds_several(tmp_path: Path) -> None:
    fine = np.arange(500.0, 521.0, 5.0)
    spectra = [
        NamedSpectrum("sky", NM, GRASS, GRASS / 9, GRASS / 9, 3),
        NamedSpectrum("sky", fine, fine / 1000),
    ]
    path = export_spectra(spectra, tmp_path / "table.csv", {})
    first, second = read_references(path).references
    assert (first.name, second.name) == ("sky", "sky (2)")
    # Written with two digits more than the first of the deviation.
    assert (np.abs(first.curve.values - GRASS) < 1e-2 * GRASS / 9).all()
    np.testing.assert_array_equal(second.curve.wavelengths_nm, fine)
    path.write_text(path.read_text("utf-8").replace("\n500,", "\nfive,"), "utf-8")
    with pytest.raises(CalibrationError, match=r"table\.csv: a cell is not a number"):
        read_references(path)


def test_a_dark_spectrum_of_a_file_in_percent_is_percent_too(tmp_path: Path) -> None:
    path = tmp_path / "two.csv"
    path.write_text("\n".join(["nm,white,black", *(f"{nm},90,1.5" for nm in range(400, 701, 10))]))
    found = read_references(path)
    assert [each.curve.values[0] for each in found.references] == [0.9, 0.015]
    assert found.as_percent == 90
    path.write_text(path.read_text().replace(",90,1.5", ",0.9,0.015"))
    assert read_references(path).as_percent is None


def test_a_library_without_a_scale_says_that_it_was_taken_for_percent(tmp_path: Path) -> None:
    path = write_library(tmp_path / "a.sli")
    assert read_references(path).as_percent is None
    path.write_bytes(np.stack([GRASS * 100, BRICK * 2]).astype("<f4").tobytes())
    found = read_references(path)
    assert found.as_percent == pytest.approx(40.0)
    np.testing.assert_allclose(found.references[0].curve.values, GRASS, rtol=1e-5)
    np.testing.assert_allclose(found.references[1].curve.values, BRICK / 50, rtol=1e-5)
    stated = write_library(tmp_path / "b.sli", {"reflectance scale factor": 1})
    stated.write_bytes(np.stack([GRASS * 2.5, BRICK]).astype("<f4").tobytes())
    assert read_references(stated).as_percent is None
