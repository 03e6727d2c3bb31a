"""The log of a scan is appended to line by line, and its torn end is dropped."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.scan.capture_log import CaptureLog, LogEntry, read_log


def entry(shot: int) -> LogEntry:
    known = {
        name: 0 for name, field in LogEntry.model_fields.items() if field.is_required() and name != "shot"
    }
    return LogEntry.model_validate({**known, "shot": shot})


@pytest.fixture
def log(tmp_path: Path) -> CaptureLog:
    made = CaptureLog(tmp_path / "log.jsonl")
    for shot in range(3):
        made.append(entry(shot))
    return made


def test_lines_are_there_at_once_and_after_opening_again(log: CaptureLog) -> None:
    assert log.entries == [entry(shot) for shot in range(3)]
    assert read_log(log.path) == (log.entries, log.path.stat().st_size)
    log.close()
    log.close()
    with pytest.raises(StoreError, match="is closed"):
        log.append(entry(3))
    again = CaptureLog(log.path)
    again.append(entry(3))
    assert [each.shot for each in read_log(log.path)[0]] == [0, 1, 2, 3]
    again.close()


def test_a_torn_end_is_dropped_and_written_over(log: CaptureLog) -> None:
    log.close()
    whole = log.path.read_bytes()
    log.path.write_bytes(whole + b'{"shot": 3, "exp')
    entries, good = read_log(log.path)
    assert (len(entries), good) == (3, len(whole))
    # A last line that ends but is damaged is torn too; one in the middle is an error.
    log.path.write_bytes(whole + b"{}\n")
    assert read_log(log.path) == (entries, len(whole))
    again = CaptureLog(log.path)
    assert log.path.read_bytes() == whole
    again.append(entry(3))
    assert len(read_log(log.path)[0]) == 4
    again.close()
    first, _, rest = whole.partition(b"\n")
    log.path.write_bytes(first + b"\n{}\n" + rest)
    with pytest.raises(StoreError, match="Line 2 of"):
        read_log(log.path)


def test_a_log_that_is_gone_is_empty_and_restored_from_memory(log: CaptureLog) -> None:
    assert not log.restore(), "nothing to do"
    whole = log.path.read_bytes()
    log.path.unlink()
    assert read_log(log.path) == ([], 0)
    assert log.restore()
    assert log.path.read_bytes() == whole
    log.append(entry(3))
    assert [each.shot for each in read_log(log.path)[0]] == [0, 1, 2, 3]
    log.path.write_bytes(whole)
    assert log.restore(), "a line that is lost"
    assert len(read_log(log.path)[0]) == 4
    log.close()
    assert log.restore(), "a closed log is opened again"
    log.append(entry(4))
    log.close()


def test_the_folder_of_a_new_log_is_made_durable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[Path] = []
    monkeypatch.setattr("dsl_core.io.scan.capture_log.sync_folder", synced.append)
    path = tmp_path / "log.jsonl"
    CaptureLog(path).close()
    assert synced == [tmp_path]
    assert path.stat().st_mode & 0o777 == 0o644 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
