"""Numbers of a table of spectra, one by one."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import Cancelled, StoreError
from dsl_core.io.export.csv import HEADER, _check_pixels, _reach_in_words, _rows, export_csv
from dsl_core.io.spectra.formats.own_table import read_own
from tests.cases.small_result import COLUMNS, ROWS, WAVELENGTHS_NM, small_result


def test_a_file_has_its_origin_its_names_and_a_row_for_each_band(tmp_path: Path) -> None:
    (path,) = export_csv(small_result(), tmp_path / "x.csv", pixels=[(2, 1), (1, 2)])
    lines = path.read_text("utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    assert "# scan_id: 2026-05-04-chart" in comments
    assert lines[len(comments)] == ",".join(HEADER)
    rows = lines[len(comments) + 1 :]
    assert len(rows) == 2 * len(WAVELENGTHS_NM)
    assert [row.split(",")[:2] for row in rows[:: len(WAVELENGTHS_NM)]] == [["2", "1"], ["1", "2"]]


def test_what_a_result_does_not_hold_is_nan_or_nothing() -> None:
    bare = small_result()[["reflectance"]]
    first = next(iter(_rows(bare, (2, 1))))
    assert first[2:4] == ("nan", "nan")
    assert first[6:] == ("nan", "nan", "", 0, "")


@pytest.mark.parametrize(
    ("reach", "words"),
    [(0, "none"), (1, "+1"), (2, "-1"), (3, "+1 and -1"), (4, "zero order only")],
)
def test_the_light_that_measured_a_band_is_named(reach: int, words: str) -> None:
    assert _reach_in_words(reach) == words


def test_pixels_are_counted_from_zero_within_the_image() -> None:
    result = small_result()
    _check_pixels(result, [(0, 0), (COLUMNS - 1, ROWS - 1)])
    outside = [(-1, 0), (COLUMNS, 0), (0, -1), (0, ROWS)]
    with pytest.raises(StoreError) as error:
        _check_pixels(result, [(0, 0), *outside])
    assert str(error.value) == (
        f"No such pixel: (-1, 0), ({COLUMNS}, 0), (0, -1), (0, {ROWS}). The image has {COLUMNS} x {ROWS}"
        f" pixels: x runs from 0 to {COLUMNS - 1}, y from 0 to {ROWS - 1}."
    )


def test_a_pixel_that_is_given_twice_is_read_back_once(tmp_path: Path) -> None:
    result = small_result()
    path = export_csv(result, tmp_path / "a.csv", pixels=[(2, 1), (1, 1), (2, 1)])[0]
    found = read_own(path)
    assert [each.name for each in found] == ["x 2, y 1", "x 1, y 1"]
    # Earlier versions wrote its rows again.
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines + [line for line in lines if line.startswith("2,1,")]))
    assert [len(each.nm) for each in read_own(path)] == [len(found[0].nm)] * 2


def test_pixels_of_averages_are_not_taken_for_others(tmp_path: Path) -> None:
    averages = small_result()[["reflectance", "reflectance_std"]].coarsen(x=2, y=2, boundary="trim").mean()
    with pytest.raises(StoreError, match="averages over several"):
        export_csv(averages, tmp_path / "a.csv", pixels=[(0, 0)])


def test_writing_asks_before_each_pixel_whether_to_go_on(tmp_path: Path) -> None:
    asked = []
    export_csv(
        small_result(), tmp_path / "x.csv", pixels=[(0, 0), (1, 0), (2, 0)], check=lambda: asked.append(1)
    )
    assert len(asked) == 3

    def stop() -> None:
        raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        export_csv(small_result(), tmp_path / "y.csv", pixels=[(0, 0)], check=stop)
    assert not (tmp_path / "y.csv").exists()
