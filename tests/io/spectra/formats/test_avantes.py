"""Columns of AvaSoft: raw counts are known as such, and a file without any is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.formats.avantes import FORMAT, read_avantes
from tests.cases import spectra_files as made


def test_raw_columns_are_counts_and_the_last_is_what_was_made_of_them(tmp_path: Path) -> None:
    path = made.write(tmp_path / "a.txt", made.avantes())
    assert FORMAT.recognises(path, path.read_bytes())
    found = read_avantes(path)
    assert [each.quantity for each in found] == ["counts"] * 3 + ["reflectance"]
    assert found[-1].nm == pytest.approx(made.NM, abs=0.01)
    assert found[-1].values == pytest.approx(made.SHARE, abs=1e-4)


def test_a_header_without_a_spectrum_is_refused(tmp_path: Path) -> None:
    text = made.avantes()
    path = made.write(tmp_path / "a.txt", text[: text.index("Wave")])
    with pytest.raises(CalibrationError, match=r"a\.txt has no spectrum"):
        read_avantes(path)
