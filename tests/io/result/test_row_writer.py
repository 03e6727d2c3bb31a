"""A result that is written by rows, interrupted and gone on with."""

from __future__ import annotations

import errno
import os
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import zarr

from dsl_core.errors import StoreError
from dsl_core.io import staging
from dsl_core.io.result import row_writer
from dsl_core.io.result.arrays import write_variable
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.io.result.row_writer import RowWriter
from dsl_core.model.result import build_result
from dsl_core.model.result_sink import Maps, MemorySink, ResultSink

NM = np.array([500.0, 550.0, 600.0])
SHAPE, BANDS = (10, 7), (slice(0, 4), slice(4, 8), slice(8, 10))
ATTRIBUTES: dict[str, str | int | float] = {"rig": "twin"}


def maps(highest: float = 1.2) -> dict[str, np.ndarray]:
    """Of the whole picture; reflectance rises from row to row."""
    rng = np.random.default_rng(3)
    cube = np.broadcast_to(np.linspace(0.1, highest, SHAPE[0])[:, None], (3, *SHAPE)).astype(np.float32)
    cube[:, 2, 3] = np.nan
    return {
        "depth_mm": rng.uniform(600, 700, SHAPE).astype(np.float32),
        "points_mm": rng.normal(size=(3, *SHAPE)).astype(np.float32),
        "reflectance": cube.copy(),
        "reach": rng.integers(0, 5, (3, *SHAPE)).astype(np.uint8),
        "flags": rng.integers(0, 900, SHAPE).astype(np.uint16),
    }


def some(given: Maps, rows: slice) -> Maps:
    return {name: values[..., rows, :] for name, values in given.items()}


def begin(sink: ResultSink, bands: tuple[slice, ...] = BANDS) -> None:
    sink.begin(SHAPE, (4, 2), NM, bands)


def write(
    target: Path, given: Maps, key: str = "a", overwrite: bool = False, bands: tuple[slice, ...] = BANDS
) -> xr.Dataset:
    """Put what is not there yet, the last rows first."""
    with RowWriter(target, key, overwrite=overwrite) as writer:
        begin(writer, bands)
        for rows in reversed(bands):
            if writer.note_of(rows) is None:
                writer.put(rows, some(given, rows), f"{rows}")
        result = writer.finish(ATTRIBUTES)
        assert result["depth_mm"].shape == SHAPE
        writer.publish({**result.attrs, "more": "of it"})
    return load_result(target, lazy=False)


def test_rows_may_hold_nothing_but_zeros(tmp_path: Path) -> None:
    """As flags of a clean surface do; a store of chunks may leave out those that hold its fill value."""
    given = maps()
    for name in ("flags", "reach", "depth_mm", "reflectance"):
        given[name][..., BANDS[1], :] = 0
    found = write(tmp_path / "rows.zarr", given)
    np.testing.assert_array_equal(found["flags"], given["flags"])
    np.testing.assert_allclose(found["reflectance"], given["reflectance"], atol=3e-5)


@pytest.mark.parametrize("highest", [1.2, 4.0])
def test_rows_make_the_result_that_is_saved_at_once(tmp_path: Path, highest: float) -> None:
    given = maps(highest)
    memory = MemorySink()
    begin(memory)
    for rows in BANDS:
        memory.put(rows, some(given, rows), "")
    at_once = memory.finish({**ATTRIBUTES, "more": "of it"})
    xr.testing.assert_identical(at_once, build_result(given, NM, {**ATTRIBUTES, "more": "of it"}, (4, 2)))
    save_result(at_once, tmp_path / "whole.zarr")
    found, wanted = write(tmp_path / "rows.zarr", given), load_result(tmp_path / "whole.zarr", lazy=False)
    # Rows that were packed before others turned out too bright for it keep their half steps.
    xr.testing.assert_allclose(found, wanted, atol=3e-5, rtol=0)
    assert found.attrs == wanted.attrs
    assert found["reflectance"].dtype == wanted["reflectance"].dtype
    assert [path.name for path in tmp_path.glob(".*")] == []


def test_a_longer_last_band_is_kept_where_earlier_rows_are_too_bright_to_be_packed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = maps()
    given["reflectance"][:, :4] *= 9.0
    safe = Counter[tuple[str, str]]()
    monkeypatch.setattr(row_writer, "make_safe", lambda file: safe.update([(file.parts[-5], file.parts[-2])]))
    found = write(tmp_path / "r.zarr", given, bands=(slice(0, 4), slice(4, 10)))
    np.testing.assert_allclose(found["reflectance"], given["reflectance"], atol=3e-5, rtol=0)
    # Rows 8 and 9 are in a file of their own. Those stored again have a note before they are.
    assert [safe["reflectance", chunk] for chunk in "012"] == [1, 2, 2]


def test_rows_that_are_there_are_not_asked_for_again(tmp_path: Path) -> None:
    given, target = maps(), tmp_path / "r.zarr"
    with RowWriter(target, "a") as writer:
        begin(writer)
        writer.put(BANDS[2], some(given, BANDS[2]), "last")
    assert not target.exists()
    with RowWriter(target, "a") as writer:
        begin(writer)
        assert [writer.note_of(rows) for rows in BANDS] == [None, None, "last"]
    xr.testing.assert_identical(write(target, given), write(tmp_path / "again.zarr", given))


def test_rows_are_counted_as_they_come_and_those_of_an_earlier_run_with_them(tmp_path: Path) -> None:
    given, seen, target = maps(), list[tuple[int, int]](), tmp_path / "r.zarr"
    with RowWriter(target, "a") as writer:
        begin(writer)
        writer.put(BANDS[1], some(given, BANDS[1]), "middle")
    with RowWriter(target, "a", seen_rows=lambda done, of: seen.append((done, of))) as writer:
        begin(writer)
        for rows in reversed(BANDS):
            if writer.note_of(rows) is None:
                writer.put(rows, some(given, rows), "")
    assert seen == [(2, 10), (6, 10), (10, 10)]


def test_what_a_killed_run_left_half_written_is_not_in_the_result(tmp_path: Path) -> None:
    given, target = maps(), tmp_path / "r.zarr"
    with RowWriter(target, "a") as writer:
        begin(writer)
        writer.put(BANDS[0], some(given, BANDS[0]), "first")
        for name in ("zarr.3452786f.partial", "depth_mm/zarr.81bd8ef9.partial"):
            (next(writer.work.glob("*/zarr.json")).parent / name).write_bytes(b"{")
    write(target, given)
    assert [path.name for path in target.rglob("*.partial")] == []


@pytest.mark.parametrize(
    ("axis", "lacks"), [("y", "c"), ("x", "c"), ("wavelength_nm", "c"), ("wavelength_nm", "zarr.json")]
)
def test_axes_of_a_run_that_was_interrupted_while_it_wrote_them_are_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, axis: str, lacks: str
) -> None:
    target, given = tmp_path / "r.zarr", maps()

    def dies(group: zarr.Group, name: str, variable: xr.Variable) -> None:
        write_variable(group, name, variable)
        if name == axis:
            begun = tmp_path / ".r.zarr.unfinished" / "result.zarr" / axis
            shutil.move(begun / lacks, tmp_path / "lost")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(row_writer, "write_variable", dies)
        with pytest.raises(StoreError, match="disk is full"):
            write(target, given)
    xr.testing.assert_identical(write(target, given), write(tmp_path / "again.zarr", given))


@pytest.mark.parametrize("change", ["key", "half written"])
def test_what_is_of_another_result_is_made_anew(tmp_path: Path, change: str) -> None:
    target = tmp_path / "r.zarr"
    with RowWriter(target, "a") as writer:
        begin(writer)
        writer.put(BANDS[0], some(maps(), BANDS[0]), "first")
    if change == "half written":
        (writer.work / "reflectance.packed").mkdir()
    with RowWriter(target, "b" if change == "key" else "a") as writer:
        begin(writer)
        assert writer.note_of(BANDS[0]) is None
    assert not writer.work.exists()


def test_two_writers_of_one_result_are_told_of_each_other(tmp_path: Path) -> None:
    with RowWriter(tmp_path / "r.zarr", "a") as one, RowWriter(tmp_path / "r.zarr", "a") as other:
        begin(one)
        with pytest.raises(StoreError, match="another process"):
            begin(other)


def test_a_result_is_replaced_only_when_that_is_wanted(tmp_path: Path) -> None:
    target = tmp_path / "r.zarr"
    write(target, maps())
    with pytest.raises(StoreError, match="already exists"):
        RowWriter(target, "a")
    assert float(write(target, maps(0.5), overwrite=True)["reflectance"].max()) == pytest.approx(0.5)


@pytest.mark.parametrize("at", ["sync", "target", "move"])
def test_a_finished_result_is_kept_whatever_disturbs_its_last_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at: str
) -> None:
    target, given = tmp_path / "r.zarr", maps()

    def disturbed(*_: Path) -> None:
        if at != "target":
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        target.mkdir()

    with monkeypatch.context() as patch:
        patch.setattr(staging, "_move_in" if at == "move" else "_sync_tree", disturbed)
        with pytest.raises(StoreError):
            write(target, given)
    if at == "target":
        target.rmdir()
    with RowWriter(target, "a") as writer:
        begin(writer)
        assert [writer.note_of(rows) for rows in BANDS] == [f"{rows}" for rows in BANDS]
    xr.testing.assert_identical(write(target, given), write(tmp_path / "again.zarr", given))
    assert [path.name for path in tmp_path.glob(".*")] == []


@pytest.mark.parametrize(
    ("number", "refused", "told"),
    [
        (errno.ENOSPC, ("mkdir", "replace"), "space"),
        (errno.EROFS, ("mkdir", "replace", "unlink", "rmdir"), "Read-only"),
    ],
)
def test_a_disk_that_fails_at_any_step_is_told_and_the_result_is_made_afterwards(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, refused: tuple[str, ...], told: str
) -> None:
    calls: list[str] = []
    room = [10**9]

    def limited(name: str) -> None:
        act = getattr(os, name)

        def instead(*arguments: Any, **more: Any) -> Any:
            calls.append(name)
            if len(calls) > room[0]:
                raise OSError(number, os.strerror(number))
            return act(*arguments, **more)

        monkeypatch.setattr(os, name, instead)

    for name in refused:
        limited(name)
    given = maps()
    write(tmp_path / "whole.zarr", given)
    last = max(step for step, name in enumerate(calls) if name == "replace")
    for after in (0, 1, 2, last - 1, last):
        calls.clear()
        room[0] = after
        with pytest.raises(StoreError, match=told):
            write(tmp_path / f"{after}.zarr", given)
        room[0] = 10**9
        assert write(tmp_path / f"{after}.zarr", given).attrs["more"] == "of it"
    calls.clear()
    room[0] = last + 1  # the result is in its place: what cannot be tidied up does not matter
    assert write(tmp_path / "kept.zarr", given).attrs["more"] == "of it"
