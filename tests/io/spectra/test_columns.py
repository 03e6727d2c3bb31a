"""Which columns of a table are spectra: by whole words of their titles, and not by letters in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.io.spectra.formats.columns import read_columns
from dsl_core.io.spectra.reference_file import read_references

NM = np.arange(400, 701, 10)
LEAF = 0.2 + 0.1 * np.sin(NM / 50)


def table(path: Path, titles: str, *columns: np.ndarray) -> Path:
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([titles, *(",".join(f"{value:g}" for value in row) for row in rows)]))
    return path


@pytest.mark.parametrize(
    ("titles", "names"),
    [
        ("wavelength,camouflage,grass", ["camouflage", "grass"]),
        ("nm,No. 1 red,pixel 2", ["No. 1 red", "pixel 2"]),
        ("nm,microwave dish,mechanical part", ["microwave dish", "mechanical part"]),
        ("nm,Terror red,Red error", ["Terror red"]),
        ("nm,leaf,leaf_std", ["leaf"]),
        ("nm,leaf,leafStd", ["leaf"]),
        ("nm,Channel,leaf", ["leaf"]),
        ("pixel number,nm,leaf", ["leaf"]),
    ],
)
def test_columns_are_left_out_by_whole_words(titles: str, names: list[str], tmp_path: Path) -> None:
    columns = [NM if title == "nm" or "wavel" in title else LEAF for title in titles.split(",")]
    found = read_columns(table(tmp_path / "some.csv", titles, *columns))
    assert [each.name for each in found] == names


def test_a_column_that_counts_rows_under_no_title_is_no_spectrum(tmp_path: Path) -> None:
    """It would pass for percent, and make the others a hundred times too dark."""
    path = table(tmp_path / "frame.csv", ",wavelength,leaf,bark", np.arange(NM.size), NM, LEAF, LEAF / 2)
    found = read_references(path)
    assert [each.name for each in found.references] == ["leaf", "bark"]
    assert found.as_percent is None
    assert found.references[0].curve.values[0] == pytest.approx(LEAF[0], rel=1e-5)
