"""A table of answers has its notes, its origin, a header and a row for each answer."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.export.table import export_table
from tests.cases.small_result import small_result


def test_notes_come_first_and_what_is_unknown_is_an_empty_cell(tmp_path: Path) -> None:
    path = tmp_path / "answers.csv"
    rows = [("leaf #2", 0.5, None), ("stone, grey", None, 3)]
    assert export_table(small_result(), ("class", "fit", "n"), rows, {"library": "usgs"}, path) == [path]
    lines = path.read_text("utf-8").splitlines()
    assert lines[0] == "# library: usgs"
    assert "# scan_id: 2026-05-04-chart" in lines
    assert lines[-3:] == ["class,fit,n", '"leaf #2",0.5,', '"stone, grey",,3']


def test_a_table_is_replaced_only_when_asked_and_ends_in_csv(tmp_path: Path) -> None:
    path = tmp_path / "answers.csv"
    export_table(small_result(), ("a",), [], {}, path)
    with pytest.raises(StoreError, match="already exists"):
        export_table(small_result(), ("a",), [], {}, path)
    export_table(small_result(), ("b",), [(1,)], {}, path, overwrite=True)
    assert path.read_text("utf-8").splitlines()[-2:] == ["b", "1"]
    with pytest.raises(StoreError, match="does not end in"):
        export_table(small_result(), ("a",), [], {}, tmp_path / "answers.txt")
