"""A result of a part of the picture: whatever leaves it names pixels of the whole picture."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.marks.panel import where
from dsl_app.results.marks.spectra import shown_spectra
from dsl_app.results.pixel_info import pixel_text
from dsl_app.results.state import SearchMode

from dsl_core.io.result.result_file import load_result, save_result
from tests.app.support.results_controller import Bench, exports
from tests.app.support.small_result import write_small_result

#: Where the part begins, and a pixel of its arrays, which is 22, 10 in the whole picture.
ORIGIN, PIXEL = (10, 4), (12, 6)


@pytest.fixture
def part(tmp_path: Path) -> Bench:
    whole = load_result(write_small_result(tmp_path), lazy=False)
    cut = whole.isel(x=slice(ORIGIN[0], 30), y=slice(ORIGIN[1], 20))
    return Bench(save_result(cut, tmp_path / "part.zarr"))


def test_a_pin_is_exported_as_the_pixel_that_was_pointed_at(part: Bench, tmp_path: Path) -> None:
    part.control.marks.pin(PIXEL)
    exports(part.control).write({"csv": tmp_path / "a.csv"}, overwrite=False)
    lines = [line for line in (tmp_path / "a.csv").read_text("utf-8").splitlines() if line[0] != "#"]
    rows = list(csv.DictReader(lines))
    assert {(row["x_px"], row["y_px"]) for row in rows} == {("22", "10")}
    pinned = part.state.marks.value[0].spectrum
    np.testing.assert_allclose([float(row["reflectance"]) for row in rows], pinned.mean, atol=1e-3)


def test_texts_name_the_pixel_of_the_whole_picture(part: Bench) -> None:
    result = part.state.result.value
    assert result is not None
    assert result.origin_px == ORIGIN
    assert pixel_text(result, PIXEL, 0).startswith("pixel 22, 10")
    part.control.marks.pin(PIXEL)
    mark = part.state.marks.value[0]
    assert where(mark, result) == "22, 10"
    assert "column 22, row 10" in shown_spectra([mark], result)[0].where
    part.state.selected.set(0)
    part.control.point_at(PIXEL)
    part.control.search.start(SearchMode.SPECTRUM)
    assert part.state.search.value is not None
    assert part.state.search.value.name == "pixel 22, 10"
    part.control.marks.pin((99, 99))
    assert "Pixel 109, 103 has no spectrum" in part.told
