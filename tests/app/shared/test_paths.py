"""Paths that the system does not tell of are answered, not raised."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.shared.known_files import Kind, first_free, has_pictures, kind_of, refusal
from dsl_app.shared.paths import MOST_NAME_BYTES, barrier, expanded, is_dir, is_file, place_trouble, there
from dsl_app.shared.settings import entry_text

from dsl_core.io.staging import staged
from tests.app.support.locked import lock

#: A name of 280 bytes.
LONG = "ü" * 140


@pytest.fixture
def locked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "locked.zarr"
    (folder / "cup.zarr").mkdir(parents=True)
    lock(monkeypatch, folder)
    return folder


def test_what_is_there_is_seen(tmp_path: Path) -> None:
    (tmp_path / "a").touch()
    assert (there(tmp_path), is_dir(tmp_path), is_file(tmp_path)) == (True, True, False)
    assert (there(tmp_path / "a"), is_dir(tmp_path / "a"), is_file(tmp_path / "a")) == (True, False, True)
    assert not there(tmp_path / "b")
    assert [barrier(path) for path in (tmp_path, tmp_path / "a", tmp_path / "b")] == ["", "", ""]


def test_what_is_barred_is_not_there_and_the_reason_is_known(locked: Path) -> None:
    for path, reason in (
        (locked / "cup.zarr", "Permission denied"),
        (locked.parent / LONG, "File name too long"),
    ):
        assert not there(path)
        assert not is_file(path)
        assert not is_dir(path)
        assert barrier(path) == reason
    assert barrier(locked) == "Permission denied"


def test_barred_files_and_folders_are_refused_with_the_reason(locked: Path) -> None:
    assert kind_of(locked) is Kind.UNKNOWN
    assert kind_of(locked / "cup.zarr") is Kind.MISSING
    assert not has_pictures(locked)
    for path in (locked, locked / "cup.zarr"):
        said = refusal(path)
        assert "cannot be read (Permission denied)" in said
        assert "no longer exists" not in said
        assert "not a whole" not in said


def test_recent_files_and_free_names_of_a_barred_folder_are_listed(locked: Path) -> None:
    assert entry_text(locked / "cup.zarr").endswith("(no access)")
    assert entry_text(locked.parent / "gone.zarr").endswith("(missing)")
    assert first_free(locked, "scan", ".dsl") == locked / "scan.dsl"


def test_a_home_that_nobody_has_is_told(tmp_path: Path) -> None:
    assert expanded(Path("~") / "scans") == Path.home() / "scans"
    nobody = expanded(Path("~no-such-user") / "scans" / "a.dsl")
    assert "~no-such-user is not a home folder" in place_trouble(nobody)
    assert place_trouble(tmp_path / "~b" / "a.dsl") == ""


def test_a_name_has_room_for_what_is_added_while_it_is_written(tmp_path: Path) -> None:
    longest = tmp_path / ("é" * (MOST_NAME_BYTES // 2))
    assert place_trouble(longest) == ""
    with staged([longest]) as (draft,):
        draft.touch()
    assert is_file(longest)
    assert "has 221 bytes, and 220 are possible" in place_trouble(tmp_path / f"{longest.name}a")


def test_a_barred_place_is_told(locked: Path) -> None:
    assert "cannot be accessed (Permission denied)" in place_trouble(locked / "a.dsl")
