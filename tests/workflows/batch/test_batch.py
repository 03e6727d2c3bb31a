"""Many scans as one batch: found, skipped where complete, failures told, stopped and waited for."""

from __future__ import annotations

import errno
import os
import platform
import re
import shutil
from collections.abc import Generator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsl_core.errors import Cancelled, StoreError
from dsl_core.io.atomic import write_atomic
from dsl_core.io.campaign_folder import SCAN_NAME, CampaignFolder
from dsl_core.io.claims import Claim, Owner
from dsl_core.io.records import replace_record
from dsl_core.io.result import row_writer
from dsl_core.io.result.result_file import load_result, read_attributes, save_result
from dsl_core.io.scan.folder import ScanReader
from dsl_core.pipeline import Options
from dsl_core.progress import CallbackProgress, NoProgress
from dsl_core.workflows.batch.batch import (
    PIXEL_BYTES,
    find_scans,
    needed_bytes,
    run_batch,
    tasks_of,
)
from dsl_core.workflows.batch.report import batch_page, batch_sentences, batch_table, is_batch_page
from dsl_core.workflows.batch.runner import Ended, Rows
from dsl_core.workflows.batch.task import Outcome, ScanTask, do_task

OPTIONS = Options(spectra=False, refine_columns=False, band_rows=16)


class Here:
    """A runner in this process."""

    def __init__(self) -> None:
        self.done = list[str]()

    def run(self, tasks: Mapping[int, ScanTask]) -> Generator[Rows | Ended, None, None]:
        for number, task in tasks.items():
            self.done.append(task.scan.name)
            rows = list[int]()
            outcome = do_task(task, lambda done, total, rows=rows: rows.append(done))  # type: ignore[misc]
            yield from (Rows(number, done) for done in rows)
            yield Ended(number, outcome)


@pytest.fixture
def folder(scan: Path, tmp_path: Path) -> Path:
    """Two scans, and one without its frames."""
    for name in ("a", "b", "c"):
        shutil.copytree(scan, tmp_path / "scans" / f"{name}.dsl")
    shutil.rmtree(tmp_path / "scans" / "b.dsl" / "frames")
    return tmp_path / "scans"


def _batch(folder: Path, runner: Here | None = None, **how: object) -> dict[str, Outcome]:
    tasks = tasks_of(find_scans(folder), options=OPTIONS, **how)  # type: ignore[arg-type]
    report = run_batch(tasks, runner or Here(), NoProgress())
    return {each.scan.stem: each for each in report.outcomes}


def test_scans_are_found_in_folders_and_lists(folder: Path, tmp_path: Path) -> None:
    listed = tmp_path / "some.txt"
    listed.write_text("\ufeffscans/b.dsl\n", encoding="utf-8")
    assert find_scans(listed) == [tmp_path / "scans/b.dsl"]
    listed.write_text("# the good ones\nscans/c.dsl\n\nscans/a.dsl\nscans/c.dsl\n")
    assert [path.name for path in find_scans(folder)] == ["a.dsl", "b.dsl", "c.dsl"]
    assert find_scans(listed) == [tmp_path / "scans/c.dsl", tmp_path / "scans/a.dsl"]
    assert find_scans(folder / "a.dsl") == [folder / "a.dsl"]
    listed.write_text("#\n")
    plan = tmp_path / "plan.json"
    plan.write_text('{\n"kind": "gray"\n}\n')
    for nothing, why in (
        (listed, "names no scan"),
        (plan, r"plan\.json is not a list of scans: nothing is at .*\{, the first path"),
        (tmp_path / "none", "does not exist"),
    ):
        with pytest.raises(StoreError, match=why):
            find_scans(nothing)
    with pytest.raises(StoreError, match="contains no scan"):
        find_scans(folder / "a.dsl" / "frames")


def test_scans_behind_links_are_found_once(folder: Path, tmp_path: Path) -> None:
    study = tmp_path / "study"
    study.mkdir()
    for name, target in (("a.dsl", folder / "c.dsl"), ("more", folder), ("loop", study)):
        try:
            (study / name).symlink_to(target, target_is_directory=True)
        except OSError:
            pytest.skip("Links cannot be made here.")
    shutil.move(folder / "a.dsl", study / "own.dsl")
    (folder / "again.dsl").symlink_to(study / "own.dsl", target_is_directory=True)
    found = [str(path.relative_to(study)) for path in find_scans(study)]
    assert found == ["a.dsl", "more/b.dsl", "own.dsl"]


def test_a_manifest_of_other_software_is_no_scan(folder: Path) -> None:
    (folder / "site").mkdir()
    for place in (folder, folder / "site"):
        (place / "manifest.json").write_text('{"name": "app", "icons": []}')
    (folder / "a.dsl").rename(folder / "leaf 1.5")
    (folder / "leaf 1.5" / "frames.jsonl").unlink()
    (folder / "b.dsl" / "manifest.json").write_text("{")
    (folder / "c.dsl").rename(folder / "leaf 1.6")
    (folder / "leaf 1.6" / "manifest.json").write_text("{")
    shutil.copytree(folder / "leaf 1.5", folder / "leaf 1.7")
    manifest = folder / "leaf 1.7" / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"plan"', '"plam"'))
    found = [path.name for path in find_scans(folder)]
    assert found == ["b.dsl", "leaf 1.5", "leaf 1.6", "leaf 1.7"], "damaged scans are scans"


def test_captures_of_a_campaign_are_no_scans_of_objects(folder: Path) -> None:
    CampaignFolder.begin(folder / "lab", "twin", {})
    steps = folder / "lab" / "geometry"
    shutil.copytree(folder / "a.dsl", steps / "pose-01" / SCAN_NAME)
    shutil.move(folder / "c.dsl", steps / "objects" / "c.dsl")
    assert [path.name for path in find_scans(folder)] == ["a.dsl", "b.dsl", "c.dsl"]
    for named in (folder / "lab", steps):
        assert [path.name for path in find_scans(named)] == ["c.dsl", SCAN_NAME]
    shutil.rmtree(steps / "objects")
    for scan in ("a.dsl", "b.dsl"):
        shutil.rmtree(folder / scan)
    with pytest.raises(StoreError, match="contains no scan of an object"):
        find_scans(folder)


def test_two_scans_never_have_one_result(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "a.dsl", folder / "more" / "a.dsl")
    assert len(tasks_of(find_scans(folder))) == 4
    with pytest.raises(StoreError, match="would both become"):
        tasks_of(find_scans(folder), tmp_path / "results")


def test_scans_that_differ_after_a_dot_have_two_results(folder: Path) -> None:
    scans = [folder / "a.dsl", folder / "c.dsl"]
    for scan, name in zip(scans, ("leaf 1.5", "leaf 1.6"), strict=True):
        scan.rename(folder / name)
    tasks = tasks_of([folder / "leaf 1.5", folder / "leaf 1.6"])
    assert [each.target.name for each in tasks] == ["leaf 1.5.zarr", "leaf 1.6.zarr"]


def test_a_failed_scan_does_not_stop_the_others_and_is_told(folder: Path) -> None:
    found = _batch(folder)
    assert {name: each.state for name, each in found.items()} == {"a": "made", "b": "failed", "c": "made"}
    assert "zarr.json is missing or damaged" in found["b"].sentence
    assert found["a"].pixels_with_depth > 0.05
    assert found["a"].cpu_s > 0
    assert found["a"].peak_bytes > 0
    assert sorted(path.name for path in folder.iterdir() if path.suffix != ".dsl") == ["a.zarr", "c.zarr"]


@pytest.mark.slow
def test_complete_results_of_the_same_frames_and_options_are_kept(folder: Path) -> None:
    _batch(folder)
    before = (folder / "a.zarr" / "zarr.json").read_bytes()
    again = _batch(folder)
    assert again["a"].state == again["c"].state == "kept"
    assert again["a"].pixels_with_depth > 0.05
    assert (folder / "a.zarr" / "zarr.json").read_bytes() == before

    other = tasks_of([folder / "a.dsl"], options=Options(spectra=False, refine_columns=False))[0]
    assert "with another calibration, options or version" in do_task(other).sentence
    forced = tasks_of([folder / "a.dsl"], options=Options(spectra=False), overwrite=True)[0]
    assert do_task(forced).state == "made"
    assert do_task(forced).state == "kept"


def test_a_result_that_python_may_have_altered_is_not_taken_for_that_of_its_scan(
    scan: Path, tmp_path: Path
) -> None:
    task = ScanTask(scan, tmp_path / "a.zarr", options=OPTIONS)
    assert do_task(task).state == "made"
    save_result(load_result(task.target, lazy=False).isel(x=slice(8)), task.target, overwrite=True)
    again = do_task(task)
    assert again.state == "failed"
    assert "does not say what it was made of, as results saved from Python do not" in again.sentence
    assert do_task(replace(task, overwrite=True)).state == "made"


def test_complete_results_are_kept_where_nothing_can_be_written(
    scan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(scan, tmp_path / "a.dsl")
    _batch(tmp_path)
    shutil.copytree(scan, tmp_path / "b.dsl")
    opened = os.open

    def refuses(path: Any, flags: int, *mode: int, **more: Any) -> int:
        if flags & (os.O_WRONLY | os.O_RDWR) and tmp_path in Path(path).parents:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        return opened(path, flags, *mode, **more)

    monkeypatch.setattr(os, "open", refuses)
    found = _batch(tmp_path)
    assert (found["a"].state, found["b"].state) == ("kept", "failed")
    assert found["a"].pixels_with_depth > 0.05
    assert "Read-only" in found["b"].sentence


def test_a_claim_that_was_taken_over_is_told_only_of_what_was_made(scan: Path, tmp_path: Path) -> None:
    shutil.copytree(scan, tmp_path / "a.dsl")
    dead = Owner(host=platform.node(), process=7)
    for state, remarks in (("made", 1), ("kept", 0)):
        replace_record(tmp_path / ".a.zarr.owner.json", dead)
        found = _batch(tmp_path)["a"]
        told = [each for each in found.remarks if "was begun by process 7" in each]
        assert (found.state, len(told)) == (state, remarks)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.dsl", "a.zarr"]


@pytest.mark.parametrize("what", ["is damaged", "is a result of schema version 0"])
def test_a_result_that_cannot_be_read_is_told_and_replaced_where_that_is_allowed(
    scan: Path, tmp_path: Path, what: str
) -> None:
    shutil.copytree(scan, tmp_path / "a.dsl")
    assert _batch(tmp_path)["a"].state == "made"
    if what == "is damaged":
        shutil.rmtree(tmp_path / "a.zarr" / "depth_mm" / "c")
    else:
        about = tmp_path / "a.zarr" / "zarr.json"
        about.write_text(re.sub(r'"schema_version": \d+', '"schema_version": 0', about.read_text()))
    refused = _batch(tmp_path)["a"].sentence
    assert what in refused
    assert refused.endswith("With --force, it is replaced.")
    assert _batch(tmp_path, overwrite=True)["a"].state == "made"
    assert _batch(tmp_path)["a"].state == "kept"


@pytest.mark.slow
def test_a_batch_that_was_killed_continues_and_ends_the_same(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, notes = write_atomic, list[str]()

    def dies(path: Path, data: bytes) -> None:
        notes.append(path.name)
        if len(notes) == 3:
            raise KeyboardInterrupt
        write(path, data)

    with monkeypatch.context() as patch:
        patch.setattr(row_writer, "write_atomic", dies)
        with pytest.raises(Cancelled, match="0 of 3 results are complete"):
            _batch(folder)
    assert len(list(folder.glob(".a.zarr.unfinished/rows.*.json"))) == 1
    _batch(folder)
    whole = tmp_path / "whole"
    _batch(folder, results=whole)
    continued, once = (load_result(where / "a.zarr") for where in (folder, whole))
    made_of = [read_attributes(where / "a.zarr")["made_of"] for where in (folder, whole)]
    assert made_of[0] == made_of[1]
    for name in once.data_vars:
        np.testing.assert_array_equal(continued[name].values, once[name].values)


def test_results_of_another_batch_are_waited_for_and_kept(folder: Path) -> None:
    runner, waits = Here(), list[float]()
    other = Claim(folder / "a.zarr")

    def wait(seconds: float) -> None:
        waits.append(seconds)
        other.release()
        do_task(tasks_of([folder / "a.dsl"], options=OPTIONS)[0])

    tasks = tasks_of(find_scans(folder), options=OPTIONS)
    report = run_batch(tasks, runner, NoProgress(), wait)
    assert runner.done == ["a.dsl", "b.dsl", "c.dsl", "a.dsl"]
    assert len(waits) == 1
    assert [each.state for each in report.outcomes] == ["kept", "failed", "made"]


def test_progress_is_one_bar_of_all_rows_and_cancels(folder: Path) -> None:
    told = list[tuple[str, int, int]]()
    progress = CallbackProgress(lambda *report: told.append(report))
    run_batch(tasks_of(find_scans(folder), options=OPTIONS), Here(), progress)
    assert {stage for stage, _, _ in told} == {"rows of 3 scans"}
    # Two bands of 16 rows, once as they come and once when the scan has ended; one scan cannot be read.
    assert [done for _, done, _ in told] == [0, 16, 32, 32, 64, 80, 96, 96]
    assert told[-1][2] == 96
    progress.token.cancel()
    with pytest.raises(Cancelled):
        run_batch(tasks_of(find_scans(folder), options=OPTIONS), Here(), progress)


def test_memory_grows_with_the_picture(folder: Path) -> None:
    small = needed_bytes(ScanTask(folder / "a.dsl", folder / "a.zarr"))
    none = needed_bytes(ScanTask(folder / "none.dsl", folder / "a.zarr"))
    assert small - none == PIXEL_BYTES * 48 * 32


def test_the_report_tells_every_scan(folder: Path, tmp_path: Path) -> None:
    report = run_batch(tasks_of(find_scans(folder), options=OPTIONS), Here(), NoProgress())
    assert report.words == "3 scans: 2 reconstructed, 1 failed."
    rows = {Path(row[0]).name: row[1:] for row in batch_table(report).rows}
    assert rows["b.dsl"] == ("failed", "", "", "", "", "")
    assert rows["a.dsl"][0] == "reconstructed"
    assert float(rows["a.dsl"][1]) > 5
    assert len(batch_sentences(report)) == 1
    page = tmp_path / "batch.html"
    assert not is_batch_page(page)
    page.write_text(batch_page(report))
    assert "1 failed" in page.read_text()
    assert is_batch_page(page)
    page.write_text("<title>Another page</title>")
    assert not is_batch_page(page)


def test_a_bug_is_the_outcome_of_its_scan_alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(self: ScanReader, folder: Path) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(ScanReader, "__init__", breaks)
    sentence = do_task(tasks_of([folder / "a.dsl"])[0]).sentence
    assert "This is a bug in dsl-scan (ZeroDivisionError: division by zero, in test_batch.py" in sentence
