"""A result whose drive does not answer, or whose files are closed, is not called damaged."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from dsl_core.errors import DriveError, StoreError
from dsl_core.io.result import inventory, result_file, stored_arrays
from dsl_core.io.result.result_file import load_result, save_result
from tests.cases.small_result import small_result


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    return save_result(small_result(), tmp_path / "a.zarr")


def _failing(number: int) -> Callable[..., object]:
    def fail(*given: object, **_: object) -> object:
        raise OSError(number, os.strerror(number), str(given[0]))

    return fail


@pytest.mark.parametrize("number", [errno.EACCES, errno.EMFILE, errno.ESTALE])
@pytest.mark.parametrize(
    ("module", "name"),
    [(result_file, "read_json"), (inventory, "require_plain"), (inventory, "read_bounded")],
)
def test_it_may_be_whole_when_it_cannot_be_opened(
    stored: Path, monkeypatch: pytest.MonkeyPatch, module: object, name: str, number: int
) -> None:
    monkeypatch.setattr(module, name, _failing(number))
    with pytest.raises(DriveError, match=r"a\.zarr.* cannot be read.*(may be whole|does not answer)"):
        load_result(stored)


@pytest.mark.parametrize("number", [errno.EACCES, errno.EMFILE])
def test_a_chunk_that_is_closed_is_not_damaged(
    stored: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    result = load_result(stored)
    monkeypatch.setattr("zarr.storage._local._get", _failing(number))
    with pytest.raises(DriveError, match="may be whole"):
        result["reflectance"].load()


def test_a_single_file_that_fails_is_damaged_and_a_whole_drive_is_away(
    stored: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = load_result(stored)
    monkeypatch.setattr("zarr.storage._local._get", _failing(errno.EIO))
    with pytest.raises(StoreError, match="is damaged"):
        result["reflectance"].load()
    monkeypatch.setattr(result_file, "read_bounded", _failing(errno.EIO))
    with pytest.raises(DriveError, match="drive does not answer"):
        result["flags"].load()
    monkeypatch.setattr(stored_arrays, "_files", _failing(errno.ESTALE))
    with pytest.raises(DriveError, match="drive does not answer"):
        result["depth_mm"].load()
