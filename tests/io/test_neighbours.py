"""What is saved next to a scan or result is called after it, whatever its name looks like."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.neighbours import beside_result, named, result_beside, stem_of
from dsl_core.io.result.annotations_file import annotations_path
from dsl_core.io.scan.folder import require_name


def test_a_folder_is_named_also_from_inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.dsl" / "frames").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "a.dsl")
    assert result_beside(Path()) == tmp_path / "a.zarr"
    assert annotations_path(Path()) == tmp_path / "a.dsl.marks.json"
    monkeypatch.chdir(tmp_path / "a.dsl" / "frames")
    assert result_beside(Path("..")) == tmp_path / "a.zarr"
    require_name(Path(".."))


def test_a_path_with_a_name_stays_as_it_was_given() -> None:
    assert named(Path("a.dsl")) == Path("a.dsl")
    assert result_beside(Path("s3:/bucket/a.dsl")) == Path("s3:/bucket/a.zarr")
    assert stem_of(Path(".zarr")) == ".zarr"


def test_the_name_proposed_for_a_scan_keeps_what_was_given() -> None:
    for given, proposed in (
        ("leaf 1.5", r"leaf 1\.5\.dsl\."),
        ("leaf.json", r"leaf\.dsl\."),
        ("a", r"a\.dsl\."),
    ):
        with pytest.raises(StoreError, match=f"Name it {proposed}$"):
            require_name(Path(given))


def test_a_whole_drive_is_neither_scan_nor_result() -> None:
    with pytest.raises(StoreError, match="is a whole drive, not a scan or result"):
        beside_result(Path("/"), ".html")
