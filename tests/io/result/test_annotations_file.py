from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.result.annotations_file import (
    Annotations,
    PinRecord,
    RegionRecord,
    annotations_path,
    load_annotations,
    save_annotations,
)


def test_marks_come_back_as_they_were(tmp_path: Path) -> None:
    marks = Annotations(
        pins=(PinRecord(name="pin 1", pixel=(3, 4)),),
        regions=(RegionRecord(name="a", outline_px=((0.5, 1.5), (2, 3), (4, 5)), runs=((1, 2, 3),)),),
    )
    save_annotations(marks, tmp_path / "scan.zarr")
    assert annotations_path(tmp_path / "scan.zarr") == tmp_path / "scan.marks.json"
    assert load_annotations(tmp_path / "scan.zarr") == marks


def test_a_dot_in_a_name_belongs_to_it(tmp_path: Path) -> None:
    for name in ("leaf 1.5", "leaf 1.6", "leaf 1.7.zarr"):
        save_annotations(Annotations(pins=(PinRecord(name=name, pixel=(3, 4)),)), tmp_path / name)
    assert [load_annotations(tmp_path / name).pins[0].name for name in ("leaf 1.5", "leaf 1.6")] == [
        "leaf 1.5",
        "leaf 1.6",
    ]
    assert (tmp_path / "leaf 1.7.marks.json").exists()


def test_no_file_means_no_marks(tmp_path: Path) -> None:
    assert load_annotations(tmp_path / "scan.zarr") == Annotations()


def test_a_damaged_file_is_named_and_put_aside(tmp_path: Path) -> None:
    (tmp_path / "scan.marks.json").write_text('{"pins": 3}')
    with pytest.raises(StoreError, match=r"scan\.marks\.json"):
        load_annotations(tmp_path / "scan.zarr")
    assert not (tmp_path / "scan.marks.json").exists()
    assert (tmp_path / "scan.marks.damaged.json").read_text() == '{"pins": 3}'
    (tmp_path / "scan.marks.json").write_text("later")
    with pytest.raises(StoreError, match=r"scan\.marks\.damaged2\.json"):
        load_annotations(tmp_path / "scan.zarr")
    assert (tmp_path / "scan.marks.damaged.json").read_text() == '{"pins": 3}'
