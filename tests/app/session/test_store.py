from __future__ import annotations

import errno
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from dsl_app.session.records import ResultsPart, Session
from dsl_app.session.store import SessionStore, is_running

#: A number that no process has.
NOBODY = 2**30
LEAF = Session(page="results", results=ResultsPart(path=Path("leaf.zarr")))


def test_a_session_is_written_only_after_a_change(tmp_path: Path) -> None:
    sessions = iter([Session(), Session(page="scan"), LEAF, LEAF, Session(page="scan")])
    store = SessionStore(tmp_path / "sessions", lambda: next(sessions), process=7)
    for _ in range(2):
        assert store.save() == ""
    # Nothing is open yet.
    assert not (tmp_path / "sessions").exists()
    assert store.save() == ""
    (file,) = (tmp_path / "sessions").iterdir()
    assert Session.model_validate_json(file.read_bytes()) == LEAF
    file.write_text("not written again")
    store.save()
    assert file.read_text() == "not written again"
    store.save()
    assert Session.model_validate_json(file.read_bytes()) == Session(page="scan")
    store.remove()
    assert not file.exists()


def test_what_a_crash_left_is_found_once(tmp_path: Path, gone: int) -> None:
    crashed = SessionStore(tmp_path, lambda: LEAF, process=gone)
    crashed.save()
    store = SessionStore(tmp_path, Session)
    assert store.crashed_session() == (LEAF, "")
    assert store.crashed_session() == (None, "")


def test_what_a_running_program_has_open_is_left_to_it(tmp_path: Path) -> None:
    other = SessionStore(tmp_path, lambda: LEAF, process=os.getpid())
    other.save()
    assert is_running(os.getpid())
    assert SessionStore(tmp_path, Session, process=NOBODY).crashed_session() == (None, "")


def test_what_a_program_on_another_computer_has_open_is_left_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gone: int
) -> None:
    monkeypatch.setattr("platform.node", lambda: "lab-2")
    elsewhere = SessionStore(tmp_path, lambda: LEAF, process=gone)
    elsewhere.save()
    monkeypatch.setattr("platform.node", lambda: "lab 1")
    assert SessionStore(tmp_path, Session).crashed_session() == (None, "")
    here = SessionStore(tmp_path, lambda: LEAF, process=gone)
    here.save()
    assert SessionStore(tmp_path, Session).crashed_session() == (LEAF, "")
    assert [path.name for path in tmp_path.iterdir()] == [f"session-lab-2-{gone}.json"]


def test_a_session_is_found_again_in_another_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gone: int
) -> None:
    monkeypatch.setattr("platform.node", lambda: "Marias-Book.fritz.box")
    SessionStore(tmp_path, lambda: LEAF, process=gone).save()
    monkeypatch.setattr("platform.node", lambda: "Marias-Book.local")
    (file,) = tmp_path.iterdir()
    by_earlier_versions = file.rename(tmp_path / f"session-Marias-Book.fritz.box-{gone}.json")
    assert SessionStore(tmp_path, Session).crashed_session() == (LEAF, "")
    assert not by_earlier_versions.exists()
    SessionStore(tmp_path, lambda: LEAF, process=gone).save()
    assert SessionStore(tmp_path, Session).crashed_session() == (LEAF, "")


def test_a_session_that_cannot_be_read_now_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gone: int
) -> None:
    SessionStore(tmp_path, lambda: LEAF, process=gone).save()

    def fail(path: Path) -> bytes:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as patch:
        patch.setattr("dsl_app.session.store.read_bounded", fail)
        found, trouble = SessionStore(tmp_path, Session).crashed_session()
    assert (found, "could not be read now" in trouble) == (None, True)
    assert SessionStore(tmp_path, Session).crashed_session() == (LEAF, "")


def test_a_damaged_session_is_put_aside_with_a_sentence(tmp_path: Path) -> None:
    (tmp_path / f"session-{NOBODY}.json").write_text('{"results": {"path": ')
    found, trouble = SessionStore(tmp_path, Session).crashed_session()
    assert found is None
    assert "could not be read" in trouble
    assert (tmp_path / f"session-{NOBODY}.damaged.json").exists()
    assert SessionStore(tmp_path, Session).crashed_session() == (None, "")


def test_a_folder_that_cannot_be_written_is_told_once(tmp_path: Path) -> None:
    (tmp_path / "sessions").write_text("a file in the way")
    sessions = iter([LEAF, Session(page="scan")])
    store = SessionStore(tmp_path / "sessions", lambda: next(sessions), process=7)
    assert "cannot be saved" in store.save()
    assert store.save() == ""


def test_a_slow_disk_keeps_nobody_waiting_and_its_failure_is_told(tmp_path: Path) -> None:
    (tmp_path / "sessions").write_text("a file in the way")
    free = threading.Event()
    with ThreadPoolExecutor(1) as writer:
        writer.submit(free.wait, 10)
        store = SessionStore(tmp_path / "sessions", lambda: LEAF, process=7, writer=writer)
        assert store.save() == ""
        # While one is being written, no other is begun.
        assert store.save() == ""
        free.set()
        writer.submit(int).result(10)
        assert "cannot be saved" in store.save()
        assert store.save() == ""
        store.remove()
