"""Only what may be replaced is: folders by their own kind, files by files, and nothing is lost between."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io import staging
from dsl_core.io.published.dataset import export_dataset
from dsl_core.io.result.result_file import RESULT_FOLDER, save_result
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.lock import FolderLock
from dsl_core.io.staging import check_targets, clear_leftovers, put_in_place, staged, write_text
from dsl_core.io.swap import exchange
from dsl_core.model.plan import CapturePlan, LineComb, Shot
from tests.cases.small_result import small_result

PLAN = CapturePlan(
    camera_size_px=(10, 7),
    projector_size_px=(16, 8),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
)


class Grey:
    """A scan of one value."""

    plan = PLAN

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        return np.full((7, 10), 1000, np.uint16)


def _save(path: Path) -> None:
    save_result(small_result(), path, overwrite=True)


def _export(path: Path) -> None:
    export_dataset(Grey(), path, overwrite=True)


def _tree(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    files = (file for file in folder.rglob("*") if file.is_file())
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}


def _documents(path: Path) -> None:
    path.mkdir()
    # A plan of ours lies where somebody works, and does not make the folder ours.
    (path / "plan.json").write_text(PLAN.model_dump_json())
    (path / "thesis.txt").write_text("years")


def _campaign(path: Path) -> None:
    path.mkdir()
    (path / "campaign.json").write_text("{}")


def _result_with_notes(path: Path) -> None:
    _save(path)
    (path / "notes.txt").write_text("mine")


def _result_around_a_scan(path: Path) -> None:
    _save(path)
    (path / "scan.dsl").mkdir()
    (path / "scan.dsl" / "manifest.json").write_text("{}")


def _results_together(path: Path) -> None:
    _save(path)
    shutil.copytree(path, path.parent / "second.zarr")
    shutil.move(path.parent / "second.zarr", path)


def _dataset_with_notes(path: Path) -> None:
    _export(path)
    (path / "notes.txt").write_text("mine")


@pytest.mark.parametrize("write", [_save, _export])
def test_a_scan_is_never_replaced(session: Path, write: Callable[[Path], None]) -> None:
    before = _tree(session)
    with pytest.raises(StoreError, match=r"scan\.dsl contains a scan and is not replaced.*another name"):
        write(session)
    with pytest.raises(StoreError, match="is not replaced"):
        write(session / "frames")
    with pytest.raises(StoreError, match="is not replaced"):
        write(session.parent)
    assert _tree(session) == before
    assert ScanReader(session).missing() == []


@pytest.mark.parametrize(
    ("lies_there", "write", "says"),
    [
        (_documents, _save, "is not a result"),
        (_documents, _export, "is not a published dataset"),
        (_campaign, _save, "contains the captures of a campaign"),
        (_campaign, _export, "contains the captures of a campaign"),
        (_save, _export, "is not a published dataset"),
        (_export, _save, "is not a result"),
        (_result_with_notes, _save, r"contains notes\.txt next to a result"),
        (_result_around_a_scan, _save, r"contains scan\.dsl next to a result"),
        (_results_together, _save, r"contains second\.zarr next to a result"),
        (_dataset_with_notes, _export, r"contains notes\.txt next to a published dataset"),
    ],
)
def test_a_folder_of_something_else_stays(
    tmp_path: Path, lies_there: Callable[[Path], None], write: Callable[[Path], None], says: str
) -> None:
    path = tmp_path / "folder"
    lies_there(path)
    before = _tree(path)
    with pytest.raises(StoreError, match=says + " and is not replaced"):
        write(path)
    assert _tree(path) == before


@pytest.mark.parametrize("write", [_save, _export])
def test_a_folder_of_its_own_kind_or_without_anything_gives_way(
    tmp_path: Path, write: Callable[[Path], None]
) -> None:
    path = tmp_path / "folder"
    path.mkdir()
    (path / ".DS_Store").write_bytes(b"left by the system")
    write(path)
    written = _tree(path)
    (path / ".DS_Store").write_bytes(b"left by the system")
    write(path)
    assert _tree(path).keys() == written.keys()
    assert [each.name for each in tmp_path.iterdir()] == ["folder"]


def test_a_file_gives_way_to_a_file_and_a_folder_to_a_folder(tmp_path: Path) -> None:
    _documents(tmp_path / "docs")
    before = _tree(tmp_path / "docs")
    with (
        pytest.raises(StoreError, match="docs is a folder, but a file is to be written"),
        staged([tmp_path / "docs"], overwrite=True) as (draft,),
    ):
        draft.write_text("a page")
    (tmp_path / "page.html").write_text("a page")
    with pytest.raises(StoreError, match=r"page\.html is a file, but a result is a folder"):
        _save(tmp_path / "page.html")
    assert _tree(tmp_path / "docs") == before
    assert (tmp_path / "page.html").read_text() == "a page"


def test_what_came_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "page.html"

    def write_slowly() -> None:
        with staged([path]) as (draft,):
            draft.write_text("ours")
            path.write_text("somebody's")

    with pytest.raises(StoreError, match="already exists"):
        write_slowly()
    assert path.read_text() == "somebody's"
    assert [each.name for each in tmp_path.iterdir()] == ["page.html"]


def test_a_link_to_nothing_is_not_replaced_either(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.symlink_to("page.html")
    with pytest.raises(StoreError, match=r"page\.html already exists"):
        check_targets([path], overwrite=False)


def test_nothing_is_written_into_a_scan_or_a_result(session: Path, tmp_path: Path) -> None:
    (tmp_path / "result.zarr").mkdir()
    (tmp_path / "result.zarr" / "zarr.json").write_text("{}")
    for target in (session / "page.html", session / "a" / "page.html", tmp_path / "result.zarr" / "a.csv"):
        with pytest.raises(StoreError, match=r"would be inside .*Choose another place"):
            check_targets([target], overwrite=True)
    with pytest.raises(StoreError, match="would be inside the scan"):
        ScanWriter.create(session / "inner.dsl", ScanReader(session).plan)


def _replace(path: Path, content: str) -> None:
    """Write the file by which a result is known; a real one renames within itself."""
    with staged([path], overwrite=True, kind=RESULT_FOLDER) as (draft,):
        draft.mkdir()
        attributes = {"schema_version": 1, "content": content}
        (draft / "zarr.json").write_text(json.dumps({"attributes": attributes}))


def _in_two_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a system that cannot exchange two names."""
    monkeypatch.setattr(staging, "exchange", lambda one, other: False)


def _interrupt_at(monkeypatch: pytest.MonkeyPatch, number: int, *, after: bool = False) -> None:
    """Let Ctrl-C arrive at a rename, before or after it is done."""
    real, count = os.replace, iter(range(1, 100))

    def replace(source: Path, target: Path) -> None:
        now = next(count)
        if now != number or after:
            real(source, target)
        if now == number:
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", replace)


@pytest.mark.parametrize(("number", "after"), [(1, False), (1, True), (2, False)])
def test_ctrl_c_between_the_renames_leaves_the_old_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, after: bool
) -> None:
    path = tmp_path / "r.zarr"
    _replace(path, "old")
    before = _tree(path)
    _in_two_steps(monkeypatch)
    _interrupt_at(monkeypatch, number, after=after)
    with pytest.raises(KeyboardInterrupt):
        _replace(path, "new")
    assert _tree(path) == before
    assert [each.name for each in tmp_path.iterdir()] == ["r.zarr"]


def test_ctrl_c_after_the_renames_leaves_the_new_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.zarr"
    _replace(path, "old")
    _in_two_steps(monkeypatch)
    _interrupt_at(monkeypatch, 2, after=True)
    with pytest.raises(KeyboardInterrupt):
        _replace(path, "new")
    assert b'"new"' in _tree(path)["zarr.json"]
    assert [each.name for each in tmp_path.iterdir()] == ["r.zarr"]


def test_an_old_result_that_cannot_come_back_is_kept_aside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.zarr"
    _replace(path, "old")
    before, real = _tree(path), os.replace

    def one_way(source: Path, target: Path) -> None:
        if target == path:
            raise PermissionError(13, "Permission denied")
        real(source, target)

    _in_two_steps(monkeypatch)
    monkeypatch.setattr(os, "replace", one_way)
    with pytest.raises(StoreError, match=r"old one is kept as .*r\.zarr\.old; move it back"):
        _replace(path, "new")
    (kept,) = tmp_path.glob(".r.zarr.*/r.zarr.old")
    assert _tree(kept) == before


def test_a_kept_old_result_returns_with_the_next_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.zarr"
    _replace(path, "old")
    before = _tree(path)
    _leave_room(tmp_path, killed=True)
    os.replace(path, tmp_path / ".r.zarr.0123abcd.partial" / "r.zarr.old")
    write_text(tmp_path / "other.txt", "anything")
    assert _tree(path) == before
    assert sorted(each.name for each in tmp_path.iterdir()) == ["other.txt", "r.zarr"]


def test_the_one_step_never_leaves_the_name_without_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.zarr"
    _replace(path, "old")
    if not exchange(path, path):
        pytest.skip("this file system cannot exchange two names")

    def no_rename(source: Path, target: Path) -> None:
        raise AssertionError("the old one steps aside")

    monkeypatch.setattr(os, "replace", no_rename)
    _replace(path, "new")
    assert b'"new"' in _tree(path)["zarr.json"]
    assert [each.name for each in tmp_path.iterdir()] == ["r.zarr"]


def _leave_room(home: Path, *, killed: bool) -> FolderLock:
    room = home / ".r.zarr.0123abcd.partial"
    room.mkdir()
    (room / "half").write_text("half a result")
    lock = FolderLock(room / "writer.lock")
    if killed:
        lock.release()
    return lock


def test_what_a_killed_writer_left_is_removed_but_not_what_another_is_writing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    lock = _leave_room(tmp_path, killed=False)
    (tmp_path / ".mine.partial").mkdir()
    write_text(tmp_path / "a.txt", "a")
    assert (tmp_path / ".r.zarr.0123abcd.partial" / "half").exists()
    lock.release()
    write_text(tmp_path / "b.txt", "b")
    assert sorted(each.name for each in tmp_path.iterdir()) == [".mine.partial", "a.txt", "b.txt"]
    assert "was left by a writer that was killed" in caplog.text


def test_a_room_that_was_not_cleared_to_its_end_is_cleared_by_the_next_writer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.zarr"
    _replace(path, "old")

    def killed(folder: Path, **_: object) -> None:
        for each in folder.iterdir():
            if each.is_file():
                each.unlink()

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", killed)
        _replace(path, "new")
    assert len(list(tmp_path.glob(".*.partial/writer.lock"))) == 1
    write_text(tmp_path / "a.txt", "a")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.txt", "r.zarr"]


def test_a_finished_folder_comes_to_its_place_in_one_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finished, replace, moved = tmp_path / "made", os.replace, list[tuple[str, str]]()
    save_result(small_result(), finished)

    def counted(source: Path, target: Path) -> None:
        moved.append((Path(source).name, Path(target).name))
        replace(source, target)

    monkeypatch.setattr(os, "replace", counted)
    put_in_place(finished, tmp_path / "r.zarr", overwrite=False, kind=RESULT_FOLDER)
    assert moved == [("made", "r.zarr")]
    assert [each.name for each in tmp_path.iterdir()] == ["r.zarr"]


def test_a_writer_that_was_killed_before_it_had_a_lock_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / ".r.zarr.0123abcd.partial").mkdir()
    write_text(tmp_path / "a.txt", "a")
    assert [each.name for each in tmp_path.iterdir()] == ["a.txt"]


def test_a_writer_whose_empty_folder_was_taken_for_left_over_makes_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[Path] = []

    def lock(path: Path) -> FolderLock:
        if not taken:
            taken.append(path)
            clear_leftovers(tmp_path)
            assert not path.parent.exists()
        return FolderLock(path)

    monkeypatch.setattr(staging, "FolderLock", lock)
    write_text(tmp_path / "a.txt", "a")
    assert [each.name for each in tmp_path.iterdir()] == ["a.txt"]


def test_a_text_replaces_another_only_where_that_is_said(tmp_path: Path) -> None:
    path = write_text(tmp_path / "a.txt", "first")
    with pytest.raises(StoreError, match="already exists"):
        write_text(path, "second")
    assert path.read_text() == "first"
    assert write_text(path, lambda: "second", overwrite=True).read_text() == "second"


def test_text_with_a_name_that_is_not_in_utf_8_is_written(tmp_path: Path) -> None:
    assert write_text(tmp_path / "a.html", "B\udce4ume").read_text(encoding="utf-8") == "B?ume"
