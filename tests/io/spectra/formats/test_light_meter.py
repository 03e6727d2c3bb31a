"""Light meters write a line for each wavelength, and the spectrum more than once."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.formats.light_meter import FORMAT, read_light_meter
from tests.cases import spectra_files as made


@pytest.mark.parametrize("label", ["Spectral Data {:.0f}[nm]", "{:.0f}nm"])
def test_the_finest_table_is_the_spectrum(tmp_path: Path, label: str) -> None:
    path = made.write(tmp_path / "lamp.xls", made.light_meter(label))
    assert FORMAT.recognises(path, path.read_bytes())
    (found,) = read_light_meter(path)
    assert (found.quantity, found.scaled) == ("irradiance", False)
    assert found.nm == pytest.approx(made.NM)
    assert found.values == pytest.approx(made.SHARE / 100, abs=1e-8)


def test_a_table_of_two_columns_is_none(tmp_path: Path) -> None:
    path = made.write(tmp_path / "a.csv", made.konica_minolta(lines=False))
    assert not FORMAT.recognises(path, path.read_bytes())


def test_a_file_cut_short_is_refused(tmp_path: Path) -> None:
    text = made.light_meter("{:.0f}nm")
    path = made.write(tmp_path / "a.csv", text[: text.index("520nm")])
    with pytest.raises(CalibrationError, match=r"a\.csv has 4 lines with a wavelength"):
        read_light_meter(path)
