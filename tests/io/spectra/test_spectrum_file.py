"""Text files of spectroradiometers: understood whatever surrounds the table, refused where they are wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.spectrum_file import read_radiances, read_spectrum

NM = np.arange(380.0, 781.0, 5.0)
VALUES = np.exp(-0.5 * ((NM - 550) / 40) ** 2) * 0.02


def _write(path: Path, header: str, separator: str = "\t", decimal: str = ".", scale: float = 1.0) -> Path:
    rows = [
        f"{nm:g}{separator}{value * scale:.8g}".replace(".", decimal)
        for nm, value in zip(NM, VALUES, strict=True)
    ]
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("header", "separator", "decimal"),
    [
        ("JETI specbos 1211\nTint [ms]\t120\nwavelength [nm]\tL [W/(sr sqm nm)]", "\t", "."),
        ("", ",", "."),
        ("Wellenlänge;Strahldichte", ";", ","),
        ('"nm" "W/m^2/sr/nm"', " ", "."),
        ("2024 11 03\n12 30 15\nnm, W/(sr m2 nm)", ",", "."),
    ],
)
def test_headers_and_separators_are_tolerated(
    tmp_path: Path, header: str, separator: str, decimal: str
) -> None:
    curve = read_spectrum(_write(tmp_path / "red.csv", header, separator, decimal))
    np.testing.assert_allclose(curve.wavelengths_nm, NM)
    np.testing.assert_allclose(curve.values, VALUES, rtol=1e-6)
    assert curve.unit == "W/(sr m2 nm)"


@pytest.mark.parametrize(
    ("unit", "scale"),
    [
        *(("mW/(sr m2 nm)", 1e3), ("µW/(sr·m²·nm)", 1e6), ("W/(m2 sr um)", 1e3), ("W/(m2 sr nm)", 1.0)),
        *(("µW/cm²/sr/nm", 1e2), ("W·sr⁻¹·m⁻³", 1e9), ("10^-3 W/m^2/nm/sr", 1e3), ("nW/cm2/nm/sr", 1e5)),
    ],
)
def test_stated_units_are_converted(tmp_path: Path, unit: str, scale: float) -> None:
    curve = read_spectrum(_write(tmp_path / "red.txt", f"wavelength (nm)\tradiance {unit}", scale=scale))
    np.testing.assert_allclose(curve.values, VALUES, rtol=1e-6)


@pytest.mark.parametrize(
    ("rows", "header"),
    [
        ([f"{nm:g};{value:.8f}" for nm, value in zip(NM[::-1], VALUES[::-1], strict=True)], "nm;radiance"),
        ([f"{nm / 1000:.3f} {v:.8f}" for nm, v in zip(NM, VALUES, strict=True)], "wavelength [µm] radiance"),
        ([f"{nm / 1000:.3f} {v:.8f}" for nm, v in zip(NM, VALUES, strict=True)], ""),
        ([f"{nm:.1f} {v:.8f}".replace(".", ",") for nm, v in zip(NM, VALUES, strict=True)], "nm L"),
        ([f'"{nm:.1f}","{v:.8f}"'.replace(".", ",") for nm, v in zip(NM, VALUES, strict=True)], ""),
        ([f"{i};{nm};{v:.8f}" for i, (nm, v) in enumerate(zip(NM, VALUES, strict=True))], "No.;Wvl;L"),
        ([f"{nm};{v:.8f};.1" for nm, v in zip(NM, VALUES, strict=True)], "nm;radiance;standard deviation"),
        (
            [f"{nm};{v:.8f};7" for nm, v in zip(NM, VALUES, strict=True)],
            "Wave;L;DN\n[nm];[W/(sr m2 nm)];[counts]",
        ),
    ],
)
def test_order_micrometres_decimal_commas_and_further_columns_are_understood(
    tmp_path: Path, rows: list[str], header: str
) -> None:
    path = tmp_path / "red.csv"
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    curve = read_spectrum(path)
    np.testing.assert_allclose(curve.wavelengths_nm, NM, rtol=1e-6)
    np.testing.assert_allclose(curve.values, VALUES, atol=6e-9)


def test_every_radiance_of_a_file_is_a_reading(tmp_path: Path) -> None:
    rows = [f"{nm};{value:.8f};{value * 2:.8f}" for nm, value in zip(NM, VALUES, strict=True)]
    path = tmp_path / "red.csv"
    path.write_text("\n".join(["nm;L1 [W/(sr m2 nm)];L2 [W/(sr m2 nm)]", *rows]), encoding="utf-8")
    first, second = read_radiances(path)
    np.testing.assert_allclose(2 * np.array(first.values), second.values, atol=3e-8)


def test_percentages_become_shares(tmp_path: Path) -> None:
    path = _write(tmp_path / "certificate.txt", "nm\tR [%]", scale=100.0)
    np.testing.assert_allclose(read_spectrum(path, radiance=False).values, VALUES, rtol=1e-6)


def _table(rows: list[str], header: str = "nm;W/(sr m2 nm)") -> str:
    return "\n".join([header, *rows])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (_table([f"{nm / 1000};1" for nm in NM]), "micrometres"),
        (_table([f"{nm};1" for nm in NM], "wavelength [µm];value"), "micrometres"),
        (_table([f"{nm};1" for nm in NM if nm < 640]), "430 to 660 nm are needed"),
        (_table([f"{nm};1" for nm in [*NM[:20], NM[18], *NM[20:]]]), "do not rise"),
        (_table([f"{nm};{'inf' if nm == 550 else 1}" for nm in NM]), "line 36"),
        (_table([f"{nm};{'nan' if nm == 550 else 1}" for nm in NM]), "no value at 550 nm"),
        (_table([f"{nm};1" for nm in NM], "nm;reflectance %"), "percent"),
        (_table([f"{nm};1" for nm in NM], "nm;counts"), "counts"),
        (_table([f"{nm};1" for nm in NM], "nm;W/(m2 nm)"), "irradiance"),
        (_table([f"{nm};{'' if nm == 550 else 1}" for nm in NM]), "no value at 550 nm"),
        (_table([f"{nm};1;2" for nm in NM], ""), r"2 spectra \('column 2', 'column 3'\)"),
        (_table([f"{nm};9000" for nm in NM], ""), "up to 9000 in no stated unit"),
        (_table([f"{nm * 20};1" for nm in NM], "cm-1;radiance"), "over wavenumber"),
        (_table([f"{2.9979e5 / nm:.3f};1" for nm in NM[::-1]], "frequency (THz);radiance"), "over frequency"),
        (_table([f"{1239.84 / nm:.5f};1" for nm in NM[::-1]], "photon energy (eV);radiance"), "over energy"),
        (_table([f"{nm};1" for nm in NM[:5]]), "with 8 rows or more"),
        (_table([f"{nm * 200};1" for nm in NM], ""), "between 150 and 50000 nm are needed"),
        ("nothing here\nbut words", "no table"),
    ],
)
def test_wrong_files_are_named_with_the_reason(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "green.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CalibrationError, match=told) as caught:
        read_spectrum(path)
    assert "green.csv" in str(caught.value)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="cannot be read"):
        read_spectrum(tmp_path / "blue.csv")


@pytest.mark.parametrize(("largest", "found"), [(1.9, 1.9), (2.1, 0.021)])
def test_shares_above_two_can_only_be_percent(tmp_path: Path, largest: float, found: float) -> None:
    text = _table([f"{nm};{largest}" for nm in range(400, 701, 10)], "nm;reflectance")
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    assert max(read_spectrum(path, radiance=False).values) == pytest.approx(found)


def test_a_deleted_radiance_is_missing_and_noise_about_zero_is_not(tmp_path: Path) -> None:
    nm = range(400, 701, 5)
    path = tmp_path / "lamp.csv"
    for value, is_kept in ((-9999.0, False), (-0.002, True)):
        rows = (f"{each},{value if each == 500 else 0.01}" for each in nm)
        path.write_text("\n".join(["nm,radiance (W/(sr m2 nm))", *rows]))
        if is_kept:
            assert min(read_spectrum(path).values) == value
        else:
            with pytest.raises(CalibrationError, match="has no value at 500 nm"):
                read_spectrum(path)
