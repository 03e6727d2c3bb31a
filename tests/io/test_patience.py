"""A drive that does not answer is waited for; files that are bad on a drive that does are told at once."""

from __future__ import annotations

import errno
import logging
import os
from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.atomic import store_error
from dsl_core.io.patience import Patience, is_away, patiently

HERE = Path("somewhere")


class _Clock:
    """Time that passes only while somebody sleeps."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def patience(self, most_s: float = 60.0) -> Patience:
        return Patience(most_s, 1.0, lambda: self.now_s, self.sleep)

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


def _away_until(clock: _Clock, back_s: float, number: int = errno.EIO) -> str:
    if clock.now_s < back_s:
        raise OSError(number, os.strerror(number))
    return "done"


def test_a_share_that_is_back_in_time_ends_nothing(caplog: pytest.LogCaptureFixture) -> None:
    clock = _Clock()
    with caplog.at_level(logging.WARNING):
        found = patiently(lambda: _away_until(clock, 20.0), HERE, patience=clock.patience())
    assert found == "done"
    assert clock.now_s == 20.0
    assert [message.split(".")[0] for message in caplog.messages] == [
        "The drive of somewhere does not answer",
        "The drive of somewhere answers again",
    ]


def test_one_that_stays_away_is_told_in_the_end() -> None:
    clock = _Clock()
    with pytest.raises(OSError, match="Input/output error"):
        patiently(lambda: _away_until(clock, 1e9), HERE, patience=clock.patience())
    assert clock.now_s == pytest.approx(60.0, abs=1.0)


@pytest.mark.parametrize("number", [errno.ENOENT, errno.EACCES, errno.ENOSPC, errno.EROFS])
def test_nobody_waits_for_a_file_that_is_missing_or_refused_or_a_full_disk(number: int) -> None:
    clock = _Clock()
    with pytest.raises(OSError, match=os.strerror(number)):
        patiently(lambda: _away_until(clock, 1e9, number), HERE, patience=clock.patience())
    assert clock.now_s == 0.0


def test_nobody_waits_for_a_bad_place_on_a_disk_that_answers() -> None:
    clock = _Clock()
    with pytest.raises(OSError, match="Input/output error"):
        patiently(lambda: _away_until(clock, 1e9), HERE, lambda: False, clock.patience())
    assert clock.now_s == 0.0


def test_an_error_that_comes_from_a_drive_is_known_through_its_sentence() -> None:
    cause = OSError(errno.ESTALE, os.strerror(errno.ESTALE))
    sentence = store_error(HERE, cause)
    sentence.__cause__ = cause
    assert is_away(sentence)
    assert not is_away(StoreError("something else"))
