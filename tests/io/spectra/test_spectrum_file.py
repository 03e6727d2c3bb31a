"""Text files of spectroradiometers: understood whatever surrounds the table, refused where they are wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.spectrum_file import read_spectrum

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
    [("mW/(sr m2 nm)", 1e3), ("µW/(sr·m²·nm)", 1e6), ("W/(m2 sr um)", 1e3), ("W/(m2 sr nm)", 1.0)],
)
def test_stated_units_are_converted(tmp_path: Path, unit: str, scale: float) -> None:
    curve = read_spectrum(_write(tmp_path / "red.txt", f"wavelength (nm)\tradiance {unit}", scale=scale))
    np.testing.assert_allclose(curve.values, VALUES, rtol=1e-6)


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
        (_table([f"{nm};1" for nm in NM[::-1]]), "do not rise"),
        (_table([f"{nm};1" for nm in [*NM[:20], NM[18], *NM[20:]]]), "do not rise"),
        (_table([f"{nm};{'nan' if nm == 550 else 1}" for nm in NM]), "line 36"),
        (_table([f"{nm};1" for nm in NM], "nm;reflectance %"), "percent"),
        (_table([f"{nm};1" for nm in NM], "nm;counts"), "counts"),
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
