from __future__ import annotations

import errno
import os
import re
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


@pytest.mark.parametrize("content", ['{"pins": 3}', '{"schema_version": 2}', "later"])
def test_a_file_that_cannot_be_read_is_named_and_stays(tmp_path: Path, content: str) -> None:
    path = tmp_path / "scan.marks.json"
    path.write_text(content)
    with pytest.raises(StoreError, match=r"scan\.marks\.json cannot be read.*rename it"):
        load_annotations(tmp_path / "scan.zarr")
    assert {each.name: each.read_text() for each in tmp_path.iterdir()} == {path.name: content}


@pytest.mark.parametrize("number", [errno.EIO, errno.EACCES, errno.EMFILE, errno.ENOMEM])
def test_marks_of_a_drive_that_does_not_answer_for_a_moment_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    marks = Annotations(pins=(PinRecord(name="pin 1", pixel=(3, 4)),))
    save_annotations(marks, tmp_path / "scan.zarr")

    def fail(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patch:
        patch.setattr(os, "stat", fail)
        with pytest.raises(StoreError, match=re.escape(os.strerror(number))):
            load_annotations(tmp_path / "scan.zarr")
    assert load_annotations(tmp_path / "scan.zarr") == marks
