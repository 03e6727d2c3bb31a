"""Batches of scans in an object store: found, brought once and only where needed, results in their place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("obstore", reason="the extra s3 is not installed")

from dsl_core.errors import StoreError
from dsl_core.io.objects import rooms, store
from dsl_core.io.objects.address import address_of
from dsl_core.io.objects.rooms import brought
from dsl_core.io.result.result_file import load_result
from dsl_core.pipeline import Options
from dsl_core.workflows.batch.batch import find_scans, needed_bytes, picture_px
from dsl_core.workflows.batch.task import ScanTask, do_task
from tests.cases.object_store import ObjectStoreTwin, running

OPTIONS = Options(spectra=False, refine_columns=False, band_rows=16)


@pytest.fixture
def stored(scan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ObjectStoreTwin]:
    """A store with the scan as ``s3://bucket/day/a.dsl``; what is brought from it is in ``cache``."""
    monkeypatch.setattr(rooms, "own_folder", lambda kind: tmp_path / "cache")
    with running() as twin:
        for name, value in twin.environment().items():
            monkeypatch.setenv(name, value)
        for file in (each for each in scan.rglob("*") if each.is_file()):
            twin.put(f"day/a.dsl/{file.relative_to(scan).as_posix()}", file.read_bytes())
        yield twin


def _frames_brought(twin: ObjectStoreTwin) -> list[str]:
    """Names of the frames that were brought since the last time."""
    found = [name for method, name in twin.requests if method == "GET" and "/frames/c." in name]
    twin.requests.clear()
    return found


@pytest.mark.parametrize("place", ["s3://bucket/out/a.zarr", "a.zarr"])
def test_a_scan_in_a_store_is_done_once(stored: ObjectStoreTwin, tmp_path: Path, place: str) -> None:
    target = Path(place) if address_of(Path(place)) else tmp_path / place
    task = ScanTask(Path("s3://bucket/day/a.dsl"), target, options=OPTIONS)
    made = do_task(task)
    assert (made.state, made.sentence) == ("made", "")
    assert (made.scan, made.target, made.pixels_with_depth > 0.05) == (task.scan, target, True)
    assert _frames_brought(stored)
    stored.refuse = lambda method, name: None if method in ("GET", "HEAD") else 403
    assert do_task(task).state == "kept", "also for who may write nothing there"
    stored.refuse = lambda method, name: None
    other = replace(task, options=Options(spectra=False))
    assert "already exists" in do_task(other).sentence
    assert not _frames_brought(stored), "what they are is told without them"
    assert do_task(task).state == "kept"
    with brought(target) as folder:
        assert "depth_mm" in load_result(folder, lazy=False)
    assert not list((tmp_path / "cache" / "objects").glob("*")), "nothing is left here"


@pytest.mark.parametrize("place", ["s3://bucket/out/a.zarr", "a.zarr"])
def test_a_scan_that_was_brought_in_part_is_completed(
    stored: ObjectStoreTwin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    monkeypatch.setattr(store, "_RETRY", {"max_retries": 0})
    target = Path(place) if address_of(Path(place)) else tmp_path / place
    task = ScanTask(Path("s3://bucket/day/a.dsl"), target, options=OPTIONS)
    seen = set[str]()

    def vanishes(method: str, name: str) -> int | None:
        if "/frames/c." not in name:
            return None
        if len(seen) == 5:
            return 503
        seen.add(name)
        return None

    stored.refuse = vanishes
    assert "does not answer" in do_task(task).sentence
    stored.refuse = lambda method, name: None
    _frames_brought(stored)
    assert do_task(task).state == "made"
    rest = _frames_brought(stored)
    assert rest
    assert not seen & set(rest)


def test_a_manifest_of_other_software_in_a_store_is_no_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    with running() as twin:
        for name, value in twin.environment().items():
            monkeypatch.setenv(name, value)
        for name in ("a.dsl/manifest.json", "leaf 1.5/manifest.json", "leaf 1.5/frames.jsonl"):
            twin.put(f"day/{name}", b"{")
        twin.put("day/leaf 1.6/manifest.json", b'{"plan": {}, "versions": {}}')
        twin.put("day/site/manifest.json", b'{"name": "app"}')
        for name in ("campaign.json", "geometry/pose-01/scan.dsl/manifest.json"):
            twin.put(f"day/lab/{name}", b"{}")
        found = [path.name for path in find_scans(Path("s3://bucket/day"))]
        assert found == ["a.dsl", "leaf 1.5", "leaf 1.6"]
        assert [path.name for path in find_scans(Path("s3://bucket/day/lab"))] == ["scan.dsl"]
        with pytest.raises(StoreError, match="contains no scan"):
            find_scans(Path("s3://bucket/day/site"))


def test_memory_grows_with_the_picture_of_a_scan_in_a_store(stored: ObjectStoreTwin, scan: Path) -> None:
    there = Path("s3://bucket/day/a.dsl")
    assert picture_px(there) == picture_px(scan) == (48, 32)
    assert needed_bytes(ScanTask(there, scan)) == needed_bytes(ScanTask(scan, scan))
    stored.put("day/cut.dsl/manifest.json", b"{")
    for unreadable in ("s3://bucket/day/none.dsl", "s3://bucket/day/cut.dsl", "s3://bucket"):
        assert picture_px(Path(unreadable)) == (0, 0)
