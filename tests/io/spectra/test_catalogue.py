"""Every format: recognised by content alone, with its spectra, quantities and units; wrong ones refused."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.catalogue import FORMATS, format_of, formats, read_spectra, suffixes
from dsl_core.io.spectra.formats.sed import is_sed
from dsl_core.io.spectra.records import Format, Spectrum
from dsl_core.io.spectra.reference_file import read_reference, read_references
from dsl_core.io.spectra.spectrum_file import read_radiances, read_spectrum
from tests.cases import spectra_files as made
from tests.cases.plugins import added_by_a_package
from tests.cases.spectra_files import NM, SHARE, SPECTRA_FILES, write

COVERS = 401.0, 699.0


@pytest.mark.parametrize(
    ("name", "format_name"),
    [
        *(("leaf.asd", "ASD FieldSpec"), ("leaf.sig", "SVC"), ("leaf.sed", "Spectral Evolution")),
        *(("ocean.txt", "Ocean"), ("avantes.txt", "Avantes"), ("cs2000.csv", "Konica Minolta CS-2000")),
        *(("plain.jdx", "JCAMP-DX"), ("packed.jdx", "JCAMP-DX"), ("pairs.dx", "JCAMP-DX")),
        *(("patches.cgats", "CGATS, ArgyllCMS"), ("leaf.spdx", "IES TM-27")),
        ("meter.csv", "Sekonic, UPRtek"),
    ],
)
def test_a_format_is_recognised_whatever_its_ending(tmp_path: Path, name: str, format_name: str) -> None:
    path = write(tmp_path / "anything.bin", SPECTRA_FILES[name])
    assert format_of(path).name == format_name


def test_endings_and_names_are_listed_once() -> None:
    assert len(set(suffixes())) == len(suffixes())
    assert {".asd", ".sig", ".sed", ".jdx", ".cgats", ".sp", ".sli", ".csv", ".txt"} <= set(suffixes())
    assert len({each.name for each in FORMATS}) == len(FORMATS)


def test_a_package_adds_a_format_by_one_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mine = Format("Mine", (".mine",), lambda path, head: head.startswith(b"mine"), lambda path: [])
    offered = [added_by_a_package("dsl_scan.spectra", mine), added_by_a_package("dsl_scan.spectra", "text")]
    with monkeypatch.context() as patch:
        patch.setattr("dsl_core.io.plugins.entry_points", lambda group: offered)
        formats.cache_clear()
        assert format_of(write(tmp_path / "a.txt", b"mine, 1, 2")).name == mine.name
        assert ".mine" in suffixes()
        assert formats()[-1] is FORMATS[-1]  # which takes any text
    formats.cache_clear()
    assert formats() == FORMATS


def test_a_format_of_another_package_that_fails_keeps_nobody_from_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(path: Path) -> list[Spectrum]:
        raise ValueError("no such block")

    offered = [
        added_by_a_package("dsl_scan.spectra", each)
        for each in (
            Format("Wild", (".wild",), lambda path, head: head.index(b"ZZZ") > 0, fails),
            Format("Mine", (".mine",), lambda path, head: head.startswith(b"mine"), fails),
        )
    ]
    with monkeypatch.context() as patch:
        patch.setattr("dsl_core.io.plugins.entry_points", lambda group: offered)
        formats.cache_clear()
        text = "nm,leaf\n" + "".join(f"{nm},0.5\n" for nm in range(400, 701, 10))
        assert len(read_spectra(write(tmp_path / "a.csv", text.encode()))) == 1
        assert "'Wild' of spectra, which another package added, failed (ValueError" in caplog.text
        with pytest.raises(CalibrationError, match=r"'Mine' of spectra.*b\.txt, .* failed .*no such block"):
            read_spectra(write(tmp_path / "b.txt", b"mine, 1, 2"))
    formats.cache_clear()


@pytest.mark.parametrize(
    "name",
    [
        *("leaf.asd", "leaf.sig", "leaf.sed", "leaf.spdx", "ocean.txt", "avantes.txt"),
        *("plain.jdx", "packed.jdx", "pairs.dx"),
    ],
)
def test_reflectance_is_a_share_over_nanometres(tmp_path: Path, name: str) -> None:
    curve = read_spectrum(write(tmp_path / name, SPECTRA_FILES[name]), COVERS, radiance=False)
    np.testing.assert_allclose(curve.wavelengths_nm, NM, rtol=1e-6)
    np.testing.assert_allclose(curve.values, SHARE, atol=1e-5)
    assert len(read_references(tmp_path / name).references) == 1


@pytest.mark.parametrize(
    ("kind", "values", "counts"),
    [
        (0, SHARE * made.COUNTS, made.COUNTS),
        (0, SHARE * made.COUNTS * 1e-4, made.COUNTS * 1e-4),
        (1, SHARE * made.COUNTS, made.COUNTS),
        (1, SHARE, made.COUNTS),
    ],
)
def test_an_asd_is_divided_by_its_white_unless_it_is_done(
    tmp_path: Path, kind: int, values: np.ndarray, counts: np.ndarray
) -> None:
    content = made.asd(kind=kind, values=values, counts=counts)
    curve = read_spectrum(write(tmp_path / "a.asd", content), COVERS, radiance=False)
    np.testing.assert_allclose(curve.values, SHARE, atol=1e-5)


def test_noise_of_a_done_asd_beyond_the_visible_does_not_divide_it_by_its_white_again(tmp_path: Path) -> None:
    nm = 350.0 + 1.0 * np.arange(2151)
    values = np.where(nm > 2498, 8.0, 0.3)
    content = made.asd(kind=1, values=values, counts=np.full(nm.size, 2e4), nm=nm)
    curve = read_spectrum(write(tmp_path / "a.asd", content), COVERS, radiance=False)
    np.testing.assert_allclose(curve.values[:2000], 0.3, rtol=1e-6)


def test_counts_of_target_and_white_are_divided_where_nothing_else_is_reflectance(tmp_path: Path) -> None:
    text = made.sed("Norm. DN (Ref.)\tNorm. DN (Target)\tChan.#")
    dark = text.replace("\t1.000000e-01\t", "\t0.000000e+00\t", 1)
    for content, lost in ((text, 0), (dark, 1)):
        found = {each.name: each for each in read_spectra(write(tmp_path / "a.sed", content))}
        assert set(found) == {"reflectance", "Norm. DN (Target)"}
        np.testing.assert_allclose(found["reflectance"].values[lost:], SHARE[lost:], atol=1e-5)
        assert np.isnan(found["reflectance"].values[:lost]).all()
    with pytest.raises(CalibrationError, match="no value at 400 nm"):
        read_spectrum(tmp_path / "a.sed", (411.0, 699.0), radiance=False)


@pytest.mark.parametrize(
    ("name", "content", "scale"),
    [
        ("a.sig", made.sig(), 1e-2),
        ("a.sed", made.sed(), 0.1),
        ("a.sed", made.sed(units="uW/cm^2/sr/nm"), 1e-3),
        ("a.asd", made.asd(kind=2, white=False, values=SHARE / 10), 0.1),
        ("a.csv", made.konica_minolta(), 1e-2),
        ("a.csv", made.konica_minolta(lines=False), 1e-2),
        ("a.sp", made.cgats("EMISSION", "1.0"), 0.1),
        ("a.sp", made.cgats("EMISSION", "100.0"), 0.1),
    ],
)
def test_radiance_is_in_one_unit(tmp_path: Path, name: str, content: str | bytes, scale: float) -> None:
    curve = read_radiances(write(tmp_path / name, content), COVERS)[0]
    np.testing.assert_allclose(curve.values, SHARE * scale, rtol=1e-5)
    assert curve.unit == "W/(sr m2 nm)"


def test_the_unit_of_a_header_is_used_once_where_light_is_the_only_column(tmp_path: Path) -> None:
    head = ["Version: 2.3", "Units: uW/cm^2/sr/nm", "Data:", "Wvl\tRad. (Target)"]
    rows = [f"{nm:.1f}\t{0.1 * r:.6e}" for nm, r in zip(NM, SHARE, strict=True)]
    (curve,) = read_radiances(write(tmp_path / "a.sed", "\n".join([*head, *rows])), COVERS)
    np.testing.assert_allclose(curve.values, SHARE * 1e-3, rtol=1e-5)


def test_a_quantity_that_a_konica_minolta_states_is_kept(tmp_path: Path) -> None:
    rows = [f"{nm:.0f},{100 * r:.5f}" for nm, r in zip(NM, SHARE, strict=True)]
    content = "\n".join(["Instrument,CS-2000A", "Wavelength [nm],Reflectance [%]", *rows])
    stated, unstated = (
        read_spectra(write(tmp_path / "a.csv", each)) for each in (content, made.konica_minolta(lines=False))
    )
    assert [each.quantity for each in stated] == ["reflectance"]
    assert [each.quantity for each in unstated] == ["radiance"]


def test_several_spectra_are_listed_by_name(tmp_path: Path) -> None:
    path = write(tmp_path / "a.cgats", made.cgats("REFLECTIVE", "100.0"))
    assert [each.name for each in read_references(path).references] == ["patch 1", "patch 2"]
    np.testing.assert_allclose(read_reference(path, "patch 2").values, SHARE / 5, atol=1e-6)
    exact = (
        made.cgats("REFLECTIVE", "100.0").replace('NM "400"', 'NM "400.3"').replace('NM "700"', 'NM "700.3"')
    )
    of_commas = read_reference(
        write(tmp_path / "commas.cgats", re.sub(r"(?<=\d)\.(?=\d)", ",", exact)), "patch 2"
    )
    np.testing.assert_allclose(of_commas.values, SHARE / 5, atol=1e-6)
    assert of_commas.wavelengths_nm[0] == pytest.approx(400.3)
    with pytest.raises(CalibrationError, match=r"2 spectra \('patch 1', 'patch 2'\)"):
        read_spectrum(path, COVERS, radiance=False)
    assert len(read_radiances(write(tmp_path / "b.csv", made.konica_minolta()), COVERS)) == 2
    rows = [f"{nm:g};{100 * r};{50 * r};{'' if nm > 600 else r}" for nm, r in zip(NM, SHARE, strict=True)]
    path = write(tmp_path / "c.csv", "\n".join(["nm;leaf [%];bark [%];moss", *rows]))
    leaf, bark, moss = read_references(path).references
    assert (leaf.name, bark.name, moss.name) == ("leaf [%]", "bark [%]", "moss")
    np.testing.assert_allclose(2 * np.array(bark.curve.values), leaf.curve.values)
    assert moss.curve.wavelengths_nm[-1] == 600


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.asd", made.asd(white=False), r"a\.asd contains counts, not a reflectance"),
        ("a.asd", made.asd(b"ASD", 8), "contains absorbance"),
        ("a.asd", made.asd()[:600], "cut off: its spectra end at byte 732, but it has 600"),
        ("a.asd", made.asd()[:760], "cut off"),
        ("a.asd", b"as7" + bytes(500), "no ASD instrument writes this"),
        (
            "a.sig",
            "/*** Spectra Vista SIG Data ***/\ndata=\n",
            "no table of wavelength, reference and target",
        ),
        ("a.sed", made.sed()[:200], "no spectrum behind its line 'Data:'"),
        ("a.txt", made.ocean("Data from USB2000 Node", 9000), "contains counts"),
        ("a.txt", made.ocean().replace("Wavelengths", "Raman Shifts"), "not over wavelength"),
        (
            "a.txt",
            made.ocean().replace("XAXIS mode: Wavelengths", "XAxis mode: Raman Shift"),
            "not over wave",
        ),
        ("a.txt", made.avantes("Scope", "[counts]"), "contains counts"),
        ("a.txt", made.avantes("Irradiance", "[µWatt/cm²/nm]"), "contains counts and irradiance"),
        (
            "a.jdx",
            made.jcamp().replace("NPOINTS=31", "NPOINTS=32"),
            "32 values are declared, but there are 31",
        ),
        (
            "a.jdx",
            made.jcamp("packed").replace("NPOINTS=31", "NPOINTS=99999999999"),
            "NPOINTS is 99999999999",
        ),
        ("a.jdx", made.jcamp("packed").replace("\n480", "Z9999999\n480"), "is repeated 9e.07 times"),
        ("a.jdx", made.jcamp("packed").replace("\n480", "\n480I"), "a line begins with"),
        ("a.jdx", made.jcamp().replace("XYDATA", "NTUPLES"), "contains NTUPLES"),
        ("a.jdx", made.jcamp().replace("(X++(Y..Y))", "(XYZ)"), "has the form"),
        ("a.cgats", made.cgats().replace("SPEC_", "LAB_"), "no spectral fields"),
        ("a.cgats", made.cgats().replace("END_DATA\n", ""), "its table does not end"),
        ("a.cgats", made.cgats().replace("patch 2", 'patch" "2'), "do not fill rows"),
        ("a.sp", made.cgats("EMISSION", "0"), "SPECTRAL_NORM of 0"),
        ("a.xlsx", b"PK\x03\x04 and so on", "Save the sheet with the spectrum as CSV"),
        ("a.spc", bytes(900), "in no format of spectra"),
    ],
)
def test_wrong_files_are_refused_with_the_reason(
    tmp_path: Path, name: str, content: str | bytes, told: str
) -> None:
    with pytest.raises(CalibrationError, match=told) as caught:
        read_references(write(tmp_path / name, content))
    assert name in str(caught.value)


def test_repeated_values_of_a_packed_file_are_counted(tmp_path: Path) -> None:
    head = (
        made.jcamp().split("##XYDATA")[0].replace("NPOINTS=31", "NPOINTS=7").replace("LASTX=700", "LASTX=460")
    )
    # 100, then three steps of +10, a difference of -30, and twice the last value.
    path = write(tmp_path / "a.jdx", f"{head}##XYDATA=(X++(Y..Y))\n400A00J0Ul0%T\n##END=")
    (spectrum,) = read_spectra(path)
    np.testing.assert_allclose(spectrum.values * 1e5, [100, 110, 120, 130, 100, 100, 100])


@pytest.mark.parametrize(("titles", "scale"), [("nm\tsample", 0.01), ("nm\tsample\twhite", 1.0)])
def test_what_a_header_says_of_all_is_believed_where_there_is_one_column(
    tmp_path: Path, titles: str, scale: float
) -> None:
    rows = ["\t".join([f"{nm:g}", *["40"] * titles.count("\t")]) for nm in range(400, 701, 10)]
    (tmp_path / "leaf.txt").write_text("\n".join(["Reflectance [%]", titles, *rows]), encoding="utf-8")
    found = read_spectra(tmp_path / "leaf.txt")
    assert len(found) == titles.count("\t")
    assert found[0].values == pytest.approx(40 * scale)


@pytest.mark.parametrize(
    ("kind", "quantity"),
    [(1, "reflectance"), (2, "radiance"), (4, "irradiance"), (6, "transmittance"), (8, "absorbance")],
)
def test_an_asd_says_what_it_measured(tmp_path: Path, kind: int, quantity: str) -> None:
    path = write(tmp_path / "a.asd", made.asd(kind=kind, white=False, values=SHARE / 10))
    assert [each.quantity for each in read_spectra(path)] == [quantity]


@pytest.mark.parametrize(
    ("at", "form", "value"),
    [
        (204, "<H", 1),
        (195, "<f", 0.009),
        (195, "<f", 1001.0),
        (191, "<f", 0.0),
        (191, "<f", 1.1e5),
        (199, "B", 3),
    ],
)
def test_a_header_that_no_asd_instrument_writes_is_refused(
    tmp_path: Path, at: int, form: str, value: float
) -> None:
    content = bytearray(made.asd())
    struct.pack_into(form, content, at, value)
    with pytest.raises(CalibrationError, match="no ASD instrument writes this"):
        read_spectra(write(tmp_path / "a.asd", bytes(content)))


def test_empty_cells_of_an_exported_table_are_unknown(tmp_path: Path) -> None:
    table = "wavelength_nm,leaf: reflectance (1),leaf: deviation (1)\n430,0.25,0.01\n435,,\n440,0.5,0.01\n"
    (leaf,) = read_spectra(write(tmp_path / "a.csv", table))
    assert leaf.name == "leaf"
    np.testing.assert_array_equal(leaf.values, [0.25, np.nan, 0.5])


@pytest.mark.parametrize(
    ("head", "found"),
    [
        (b"Version: 1\nData:\nWvl\tReflect. %\n", True),
        (b"Version: 1\nData: 3 columns\nChan.#\tWvl\n", True),
        (b"Version: 1\nData:\nwavelength\n", False),
        (b"Wvl\tReflect. %\n", False),
    ],
)
def test_a_line_data_with_its_columns_below_is_of_spectral_evolution(head: bytes, found: bool) -> None:
    assert is_sed(Path("a.txt"), head) is found


def test_names_over_pairs_of_columns_are_those_of_the_spectra(tmp_path: Path) -> None:
    rows = [f"{nm:.2f},{100 * r:.5f},{nm:.2f},{50 * r:.5f}," for nm, r in zip(NM, SHARE, strict=True)]
    head = ["Azurite,,Malachite,,", "Wavelength (nm),%R,Wavelength (nm),%R,"]
    spectra = read_spectra(write(tmp_path / "cary.csv", "\n".join([*head, *rows, "", "Cary 5000"])))
    assert [each.name for each in spectra] == ["Azurite", "Malachite"]
    np.testing.assert_allclose(spectra[1].values, SHARE / 2, atol=1e-6)


def test_a_table_with_bars_around_its_cells_is_read(tmp_path: Path) -> None:
    rows = [f"| {nm:.2f} | {100 * r:.5f} | {50 * r:.5f} |" for nm, r in zip(NM, SHARE, strict=True)]
    head = ["| Wavelength (nm) | Azurite (%) | Malachite (%) |", "|---|:--:|---|"]
    spectra = read_spectra(write(tmp_path / "report.md.txt", "\n".join([*head, *rows])))
    assert [each.name for each in spectra] == ["Azurite (%)", "Malachite (%)"]
    np.testing.assert_allclose(spectra[1].values, SHARE / 2, atol=1e-6)


@pytest.mark.parametrize("said", ["leaf_Reflection__0__.txt", "leaf_Transmission_10-1.txt", "leaf 12 %R"])
@pytest.mark.parametrize("level", [1.0, 0.01])
def test_ocean_is_in_percent_however_dark_a_sample_is(tmp_path: Path, said: str, level: float) -> None:
    path = write(tmp_path / "a.txt", made.ocean(f"Data from {said} Node", 100 * level))
    found = read_references(path)
    np.testing.assert_allclose(found.references[0].curve.values, SHARE * level, atol=1e-7)
    assert found.as_percent is None
