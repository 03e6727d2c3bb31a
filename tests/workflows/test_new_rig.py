"""A package for a rig of one's own: named as asked, refused where it cannot be."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.workflows.new_rig import write_new_rig


def test_the_files_bear_the_name(tmp_path: Path) -> None:
    files = write_new_rig("room-12", tmp_path / "room", [])
    assert [path.name for path in files] == ["pyproject.toml", "room_12.py", "test_room_12.py"]
    points = tomllib.loads(files[0].read_text("utf-8"))["project"]["entry-points"]["dsl_scan.rigs"]
    assert points == {"room-12": "room_12:open_lab"}
    for path in files:
        text = path.read_text("utf-8")
        assert "my_lab" not in text
        assert "my-lab" not in text


@pytest.mark.parametrize(
    "name",
    ["", "Room", "a b", "-a", "a--b", "../a", "3d", "twin", "lambda", "x" * 50, "numpy", "email", "dsl-core"],
)
def test_names_that_cannot_be_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(StoreError, match="Choose another name"):
        write_new_rig(name, tmp_path / "room", ["twin"])
    assert not (tmp_path / "room").exists()


def test_an_empty_folder_of_the_name_is_no_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "lab").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    assert write_new_rig("lab", tmp_path / "lab", [])


def test_a_folder_with_something_in_it_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(StoreError, match="not an empty folder"):
        write_new_rig("room-12", tmp_path, [])
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
