"""What was interrupted in a folder is found, and a reconstruction is continued as it was begun."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from dsl_core.capture.metering import WHITE_IN_DOUBT
from dsl_core.errors import StoreError
from dsl_core.io import MANIFEST_NAME, staging
from dsl_core.io.atomic import write_atomic
from dsl_core.io.records import replace_record
from dsl_core.io.result import row_writer
from dsl_core.io.result.result_file import load_result
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.scan.lock import FolderLock
from dsl_core.io.scan.manifest import read_manifest
from dsl_core.io.scan.proof_file import PROOF_NAME, read_proof, save_proof
from dsl_core.model.attributes import DOUBTS
from dsl_core.model.result_sink import Maps
from dsl_core.model.scan_proof import ScanProof
from dsl_core.pipeline import Options
from dsl_core.progress import CallbackProgress
from dsl_core.workflows import scans
from dsl_core.workflows.unfinished import (
    _options_of,
    resume_result,
    unfinished_results,
    unfinished_scans,
)
from tests.cases.stranger_folders import FOLDERS

OPTIONS = Options(spectra=False, refine_columns=False, band_rows=16)


@pytest.fixture
def killed(scan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the scan, whose reconstruction was killed after its first band of rows."""
    copy = shutil.copytree(scan, tmp_path / "a.dsl")
    _kill_reconstruction(copy, monkeypatch)
    return copy


def _kill_reconstruction(scan: Path, monkeypatch: pytest.MonkeyPatch, *, overwrite: bool = False) -> None:
    write, notes = write_atomic, list[str]()

    def dies(path: Path, data: bytes) -> None:
        notes.append(path.name)
        if len(notes) == 3:
            raise KeyboardInterrupt
        write(path, data)

    with monkeypatch.context() as patch:
        patch.setattr(row_writer, "write_atomic", dies)
        with pytest.raises(KeyboardInterrupt):
            scans.reconstruct_to(scan.with_suffix(".zarr"), scan, None, OPTIONS, overwrite=overwrite)


def test_an_interrupted_reconstruction_is_found_and_continued(killed: Path, tmp_path: Path) -> None:
    (found,) = unfinished_results(tmp_path)
    assert (found.target, found.scan) == (tmp_path / "a.zarr", killed)
    assert (found.done, found.total, found.options) == (1, 2, OPTIONS)
    assert resume_result(found) == tmp_path / "a.zarr"
    assert "depth_mm" in load_result(tmp_path / "a.zarr")
    assert unfinished_results(tmp_path) == ()


def test_one_that_was_to_replace_a_result_still_does(
    killed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (begun,) = unfinished_results(tmp_path)
    resume_result(begun)
    _kill_reconstruction(killed, monkeypatch, overwrite=True)
    (found,) = unfinished_results(tmp_path)
    assert (begun.overwrite, found.overwrite) == (False, True)
    assert resume_result(found) == tmp_path / "a.zarr"
    assert unfinished_results(tmp_path) == ()


def test_a_result_that_came_meanwhile_is_not_replaced(killed: Path, tmp_path: Path) -> None:
    (found,) = unfinished_results(tmp_path)
    scans.reconstruct_to(tmp_path / "b.zarr", killed, None, OPTIONS)
    (tmp_path / "b.zarr").rename(found.target)
    with pytest.raises(StoreError, match="already exists"):
        resume_result(found)


def test_a_run_killed_as_its_result_was_moved_in_is_not_offered(
    killed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dies(folder: Path) -> None:
        if (folder / "a.zarr").exists():
            raise KeyboardInterrupt

    work = tmp_path / ".a.zarr.unfinished"
    by_earlier_versions = shutil.copytree(work, tmp_path / "copy")
    with monkeypatch.context() as patch:
        patch.setattr(staging, "sync_folder", dies)
        with pytest.raises(KeyboardInterrupt):
            scans.reconstruct_to(tmp_path / "a.zarr", killed, None, OPTIONS)
    assert (load_result(tmp_path / "a.zarr").sizes["y"], work.exists()) == (32, False)
    by_earlier_versions.rename(work)
    assert len(unfinished_results(tmp_path)) == 1
    shutil.rmtree(work / "result.zarr")
    assert unfinished_results(tmp_path) == ()


@pytest.mark.parametrize("is_judged", [True, False])
def test_the_last_stages_of_a_reconstruction_are_told(scan: Path, tmp_path: Path, is_judged: bool) -> None:
    copy = shutil.copytree(scan, tmp_path / "a.dsl")
    if not is_judged:
        (copy / PROOF_NAME).unlink()
    told: list[str] = []
    progress = CallbackProgress(lambda stage, _done, _total: told.append(stage))
    scans.reconstruct_to(tmp_path / "b.zarr", copy, None, OPTIONS, progress)
    judging = [] if is_judged else ["compare frames with their patterns"]
    assert list(dict.fromkeys(told))[-2 - len(judging) :] == [
        "colour and result",
        *judging,
        "save the result",
    ]


def test_geometry_is_seen_before_the_spectra_of_the_part_asked_for(scan: Path) -> None:
    seen: list[Maps] = []
    options = replace(OPTIONS, region_px=(8, 4, 20, 12))
    result = scans.reconstruct_scan(scan, None, options, seen_geometry=seen.append)
    (maps,) = seen
    for name in ("depth_mm", "depth_std_mm", "points_mm", "normals", "flags"):
        np.testing.assert_array_equal(maps[name], result[name].values)


def test_no_stage_divides_tensors_among_threads_that_wait_for_each_other(scan: Path) -> None:
    used: list[int] = []
    progress = CallbackProgress(lambda _stage, _done, _total: used.append(torch.get_num_threads()))
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        scans.reconstruct_scan(
            scan, None, OPTIONS, progress, seen_geometry=lambda _: used.append(torch.get_num_threads())
        )
        after = torch.get_num_threads()
    finally:
        torch.set_num_threads(before)
    assert (set(used), after) == ({1}, 2)


def test_a_finished_scan_knows_what_its_pictures_show(scan: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(scan, tmp_path / "a.dsl")
    reader = ScanReader(copy)
    assert reader.calibration is not None
    assert read_proof(reader, reader.calibration) == scans.prove_scan(copy)
    kept = ScanProof(judged=9, untold=2, wrong=("Frame 7 is late.",))
    save_proof(reader, reader.calibration, kept)
    result = scans.reconstruct_scan(copy, None, OPTIONS)
    assert json.loads(result.attrs[DOUBTS]) == ["Frame 7 is late."]
    assert result.attrs[scans.NOT_JUDGED] == "2 of 9"
    (copy / PROOF_NAME).unlink()
    assert DOUBTS not in scans.reconstruct_scan(copy, None, OPTIONS).attrs
    assert scans.known_doubts(copy) == []


def test_damaged_pictures_are_left_out_of_what_a_scan_shows(scan: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(scan, tmp_path / "a.dsl")
    reader = ScanReader(copy)
    damaged = set(reader.plan.references().values())
    for shot in damaged:
        reader.store.path(shot.index).write_bytes(b"")
    assert scans.prove_scan(copy).judged == reader.plan.shot_count - len(damaged)
    assert "frames are missing" in scans.linearity_of_scan(copy).sentence


def test_what_white_contradicted_before_a_scan_is_repeated_by_its_result(scan: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(scan, tmp_path / "a.dsl")
    (copy / PROOF_NAME).unlink()
    known = read_manifest(copy)
    notes = known.notes | {WHITE_IN_DOUBT: "White is blue: 3 times."}
    replace_record(copy / MANIFEST_NAME, known.model_copy(update={"notes": notes}))
    reader = ScanReader(copy)
    assert reader.calibration is not None
    kept = ScanProof(judged=9, untold=0, wrong=("Frame 7 is late.",))
    save_proof(reader, reader.calibration, kept)
    doubts = ["White is blue: 3 times.", "Frame 7 is late."]
    assert json.loads(scans.reconstruct_scan(copy, None, OPTIONS).attrs[DOUBTS]) == doubts
    assert scans.known_doubts(copy) == doubts
    (copy / PROOF_NAME).unlink()
    again = ScanProof(judged=9, untold=0, wrong=("White is blue: 2 times.",))
    save_proof(reader, reader.calibration, again)
    assert scans.known_doubts(copy) == ["White is blue: 2 times."]


def test_one_that_runs_or_whose_scan_is_gone_is_not_offered(killed: Path, tmp_path: Path) -> None:
    lock = FolderLock(tmp_path / ".a.zarr.unfinished" / "writer.lock")
    assert unfinished_results(tmp_path) == ()
    lock.release()
    assert len(unfinished_results(tmp_path)) == 1
    shutil.rmtree(killed)
    assert unfinished_results(tmp_path) == ()


@pytest.mark.parametrize(
    ("part", "instead"),
    [
        (") 4 [", ") 0 ["),
        ("[", "[" * 5000),
        ("Options(", "Options(a=" + "-" * 20_000),
        ("Options(", "Options(a=" + "f(" * 150),
        ("(8, 12)", f"({'9' * 6000}, 12)"),
    ],
    ids=["no height", "nested facts", "nested options", "nested calls", "long number"],
)
def test_a_damaged_beginning_of_a_result_is_left_out(tmp_path: Path, part: str, instead: str) -> None:
    begun = next(each for each in FOLDERS if each.name == "begun result")
    begun.make(tmp_path)
    assert len(unfinished_results(tmp_path)) == 1
    key = tmp_path / begun.file
    key.write_text(key.read_text().replace(part, instead, 1))
    assert unfinished_results(tmp_path) == ()


def test_a_scan_that_lacks_frames_is_found(scan: Path, tmp_path: Path) -> None:
    assert unfinished_scans(scan.parent) == ()
    copy = shutil.copytree(scan, tmp_path / "b.dsl")
    log = copy / "frames.jsonl"
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines[:-2]))
    total = ScanReader(scan).plan.shot_count
    (found,) = unfinished_scans(tmp_path)
    assert (found.folder, found.done, found.total) == (copy, total - 2, total)
    log.write_bytes(b"")
    assert unfinished_scans(tmp_path) == (), "a scan of no frames is as good as a new one"
    log.write_bytes(lines[0])
    assert [each.done for each in unfinished_scans(tmp_path)] == [1]
    (tmp_path / "c.dsl").mkdir()
    (tmp_path / "c.dsl" / "manifest.json").write_text("{")
    assert len(unfinished_scans(tmp_path)) == 1


def test_options_are_read_back_only_where_nothing_is_lost() -> None:
    for options in (Options(), OPTIONS, Options(region_px=(1, 2, 3, 4), solver="published")):
        assert _options_of(repr(options)) == options
    for text in ("Options(later=1)", "3", repr(Options()).replace("'auto'", '"auto"')):
        with pytest.raises((ValueError, TypeError)):
            _options_of(text)
