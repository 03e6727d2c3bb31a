"""A bit flipped anywhere in a result is told or changes nothing; a file that is missing is told."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from dsl_core.errors import StoreError
from dsl_core.io.describe import describe
from dsl_core.io.result.result_arrays import load_arrays
from dsl_core.io.result.result_file import has_checksums, load_result, save_result
from dsl_core.progress import CallbackProgress, CancelToken
from tests.cases.small_result import small_result


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_result(small_result(), tmp_path_factory.mktemp("stored") / "a.zarr")


@pytest.fixture
def copied(stored: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(stored, tmp_path / "a.zarr"))


def test_flipped_bits_are_told_or_harmless(stored: Path, copied: Path) -> None:
    whole = load_result(stored, lazy=False)
    rng = np.random.default_rng(1)
    files = sorted(path for path in copied.rglob("*") if path.is_file())
    told = 0
    for path in files:
        data = path.read_bytes()
        place = int(rng.integers(0, 8 * len(data)))
        flipped = bytearray(data)
        flipped[place // 8] ^= 1 << place % 8
        path.write_bytes(flipped)
        try:
            xr.testing.assert_identical(load_result(copied, lazy=False), whole)
        except StoreError:
            told += 1
        path.write_bytes(data)
    assert told > 0.8 * len(files)


def test_a_damaged_band_is_told_when_it_is_read(copied: Path) -> None:
    path = copied / "reflectance" / "c" / "0" / "0" / "0"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    assert "not compared" in describe(copied)["checksums"]
    with pytest.raises(StoreError, match="is damaged"):
        describe(copied, verify=True)
    lazy = load_result(copied)
    lazy["depth_mm"].load()
    with pytest.raises(StoreError, match="is damaged"):
        lazy["reflectance"].load()
    with pytest.raises(StoreError, match="Reconstruct it again"):
        load_result(copied, lazy=False)


@pytest.mark.parametrize("name", ["reflectance/c/0/0/0", "depth_mm/c/0/0", "flags/zarr.json"])
def test_a_file_that_is_missing_or_cut_off_is_told(copied: Path, name: str) -> None:
    path = copied / name
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(StoreError, match=rf"{name} has \d+ of \d+ bytes"):
        load_result(copied)
    path.unlink()
    with pytest.raises(StoreError, match=f"{name} cannot be read"):
        load_result(copied)


def test_an_array_that_was_added_is_told(copied: Path) -> None:
    shutil.copytree(copied / "depth_mm", copied / "more")
    with pytest.raises(StoreError, match=r"more/zarr\.json was added"):
        load_result(copied)


def _move(folder: Path) -> None:
    folder.rename(folder.with_name("moved.zarr"))


def _replace(folder: Path) -> None:
    other = small_result()
    save_result(other.assign(reflectance=other["reflectance"] * 0.5), folder, overwrite=True)


def _replace_by_fewer_rows(folder: Path) -> None:
    save_result(small_result().isel(y=slice(0, 4)), folder, overwrite=True)


def _lose_a_chunk(folder: Path) -> None:
    (folder / "reflectance" / "c" / "0" / "0" / "0").unlink()


@pytest.mark.parametrize("change", [_move, shutil.rmtree, _replace, _replace_by_fewer_rows, _lose_a_chunk])
def test_a_result_that_is_no_longer_the_one_opened_is_told_when_it_is_read(
    copied: Path, change: Callable[[Path], None]
) -> None:
    lazy = load_result(copied)
    change(copied)
    with pytest.raises(StoreError, match=r"a\.zarr was moved, removed or replaced since it was opened"):
        lazy["reflectance"].sel(x=3, y=2).load()
    with pytest.raises(StoreError, match="Load it again from where it is now"):
        save_result(lazy, copied.with_name("again.zarr"))


def test_a_drive_that_goes_while_all_is_read_is_told(copied: Path) -> None:
    def report(_: str, done: int, __: int) -> None:
        if done == 3:
            _move(copied)

    with pytest.raises(StoreError, match="was moved, removed or replaced"):
        load_arrays(copied, CallbackProgress(report, CancelToken()))


def test_a_result_is_read_by_a_script_that_changes_its_folder(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(copied.parent)
    lazy = load_result(Path(copied.name))
    (copied.parent / "elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    xr.testing.assert_identical(lazy.load(), load_result(copied, lazy=False))


@pytest.mark.skipif(sys.platform == "win32", reason="pipes have no place in folders there")
@pytest.mark.parametrize("is_old", [False, True])
def test_a_pipe_in_the_place_of_a_chunk_is_not_waited_for(copied: Path, is_old: bool) -> None:
    if is_old:
        _without_checksums(copied)
    (copied / "depth_mm" / "c" / "0" / "0").unlink()
    os.mkfifo(copied / "depth_mm" / "c" / "0" / "0")
    with pytest.raises(StoreError, match="a pipe or a device"):
        load_result(copied, lazy=False)


def _without_checksums(folder: Path) -> None:
    content = json.loads((folder / "zarr.json").read_text())
    del content["attributes"]["inventory"], content["attributes"]["attributes_crc32"]
    (folder / "zarr.json").write_text(json.dumps(content))


def test_a_result_of_an_earlier_version_opens_and_says_so(
    copied: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert describe(copied)["checksums"] == "of every chunk, not compared"
    assert describe(copied, verify=True)["checksums"] == "of every chunk, compared"
    _without_checksums(copied)
    assert load_result(copied).sizes["wavelength_nm"] == 5
    assert "was written without checksums" in caplog.text
    assert not has_checksums(copied)
    assert "damage would not be noticed" in describe(copied)["checksums"]


def test_an_array_that_declares_more_than_it_can_hold_is_refused(copied: Path) -> None:
    _without_checksums(copied)
    path = copied / "depth_mm" / "zarr.json"
    content = json.loads(path.read_text())
    content["shape"] = [6_000_000, 9_000]
    path.write_text(json.dumps(content))
    with pytest.raises(StoreError, match=r"which its .* bytes cannot hold"):
        load_result(copied)
