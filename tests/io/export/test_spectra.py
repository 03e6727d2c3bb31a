"""Tables of spectra are opened by readers that nobody here wrote, and as references."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.export.spectra import NamedSpectrum, export_spectra, spectra_as_text
from dsl_core.io.spectra.reference_file import read_reference, read_references

NM = np.arange(430.0, 661.0, 10.0)
RAMP = np.linspace(0.1, 0.9, NM.size).astype(np.float32)
REGION = NamedSpectrum("sky, 50 % grey", NM, RAMP, np.full(NM.size, 0.02), np.full(NM.size, 0.01), 30)
FINER = np.arange(500.0, 521.0, 5.0)
REFERENCE = NamedSpectrum("tile", FINER, np.full(FINER.size, 0.25))
SOURCE = {"scan_id": "2026-05-04-chart", "calibration": "twin μ-rig"}


def test_pandas_reads_every_column_with_its_unit(tmp_path: Path) -> None:
    import colour  # noqa: F401 - it changes how NumPy prints, which must not reach the file

    pandas = pytest.importorskip("pandas")
    path = export_spectra([REGION, REFERENCE], tmp_path / "spectra.csv", SOURCE)
    table = pandas.read_csv(path, comment="#")
    assert list(table.columns) == [
        "wavelength_nm",
        "sky, 50 % grey: reflectance (1)",
        "sky, 50 % grey: deviation of its pixels (1)",
        "sky, 50 % grey: n (pixels)",
        "sky, 50 % grey: uncertainty of a pixel (1)",
        "tile: reflectance (1)",
    ]
    own = table.dropna(subset=[table.columns[1]])
    np.testing.assert_array_equal(own["wavelength_nm"], NM)
    np.testing.assert_allclose(own.iloc[:, 1], RAMP, atol=0.02 / 30**0.5 / 100)
    assert set(own.iloc[:, 3]) == {30}
    tile = table.dropna(subset=[table.columns[5]])
    np.testing.assert_array_equal(tile["wavelength_nm"], FINER)
    text = path.read_text("utf-8")
    assert "# scan_id: 2026-05-04-chart\n" in text
    assert "# exported_by: dsl-scan" in text


def test_a_name_with_the_sign_of_comments_cuts_no_table(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    named = [replace(REFERENCE, name=name) for name in ("sample #3", '#4 "a", b')]
    path = export_spectra([*named, REGION], tmp_path / "spectra.csv", SOURCE)
    table = pandas.read_csv(path, comment="#")
    assert table.columns[1:3].tolist() == ["sample #3: reflectance (1)", '#4 "a", b: reflectance (1)']
    assert table.columns[3] == "sky, 50 % grey: reflectance (1)"
    assert table.dropna(subset=[table.columns[1]]).iloc[:, 1].tolist() == [0.25] * FINER.size
    names = [each.name for each in read_references(path).references]
    assert names == ["sample #3", '#4 "a", b', "sky, 50 % grey"]


def test_the_clipboard_gets_tabs_and_empty_cells() -> None:
    head, first, *_ = spectra_as_text([REGION, REFERENCE]).splitlines()
    assert head.split("\t")[0] == "wavelength_nm"
    assert first.split("\t") == ["430", "0.10000", "0.02", "30", "0.01", ""]


def test_a_spectrum_is_read_again_as_a_reference(tmp_path: Path) -> None:
    path = export_spectra([REGION], tmp_path / "spectra.csv", SOURCE)
    curve = read_reference(path)
    np.testing.assert_array_equal(curve.wavelengths_nm, NM)
    # A name with a per cent sign is no unit.
    np.testing.assert_allclose(curve.values, RAMP, atol=0.02 / 30**0.5 / 100)


def test_a_wavelength_that_two_spectra_round_differently_is_one_row(tmp_path: Path) -> None:
    bands = 430 + np.arange(57) * 4.1
    tile = np.round(np.arange(4000, 7001) / 10, 1)
    assert len({*bands.tolist()} - {*tile.tolist()}) > 0, "some differ in their last digits"
    spectra = [NamedSpectrum("pin", bands, bands / 1000), NamedSpectrum("tile", tile, tile / 2000)]
    path = export_spectra(spectra, tmp_path / "spectra.csv", SOURCE)
    found = {each.name: each.curve for each in read_references(path).references}
    np.testing.assert_allclose(found["pin"].wavelengths_nm, bands)
    np.testing.assert_array_equal(found["tile"].wavelengths_nm, tile)


def test_nothing_is_replaced_unasked_and_nothing_written_of_nothing(tmp_path: Path) -> None:
    path = export_spectra([REGION], tmp_path / "spectra.csv", {})
    with pytest.raises(StoreError, match="already exists"):
        export_spectra([REFERENCE], path, {})
    export_spectra([REFERENCE], path, {}, overwrite=True)
    with pytest.raises(StoreError, match="at least one"):
        export_spectra([], tmp_path / "none.csv", {})
    with pytest.raises(StoreError, match="does not end in"):
        export_spectra([REGION], tmp_path / "spectra.doc", {})
