"""Tasks on the workers of a scheduler of Dask: the same as in processes; a sentence where there is none."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="the extra cluster is not installed")

from distributed import LocalCluster

from dsl_core.errors import DeviceError
from dsl_core.workflows.batch import cluster
from dsl_core.workflows.batch.cluster import Cluster
from dsl_core.workflows.batch.runner import Ended, Rows
from dsl_core.workflows.batch.task import Outcome, ScanTask, SeenRows
from tests.cases import batch_work as work
from tests.workflows.batch.test_processes import tasks_in

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")


def _scheduler(workers: int) -> LocalCluster:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=False,
            protocol="tcp",
            host="127.0.0.1",
            dashboard_address=None,
        )


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with _scheduler(1) as found:
        yield str(found.scheduler_address)


def test_every_task_is_done_once_and_tells_of_its_rows(address: str, tmp_path: Path) -> None:
    tasks = tasks_in(tmp_path, "abc")
    events = list(Cluster(address, work.quick).run(tasks))
    assert {e.task: e.outcome.state for e in events if isinstance(e, Ended)} == dict.fromkeys(
        range(3), "made"
    )
    assert {e for e in events if isinstance(e, Rows)} <= {Rows(i, 1) for i in range(3)}
    assert [work.begun(task) for task in tasks.values()] == [1, 1, 1]


def test_paths_lead_to_the_same_from_the_folder_of_a_worker(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given = {
        0: ScanTask(Path("scans/a.dsl"), Path("results/a.zarr")),
        1: ScanTask(Path("s3://bucket/b.dsl"), tmp_path / "b.zarr"),
    }
    got = {e.task: e.outcome for e in Cluster(address, _told).run(given) if isinstance(e, Ended)}
    assert (got[0].scan, got[0].target) == (tmp_path / "scans/a.dsl", tmp_path / "results/a.zarr")
    assert (got[1].scan, got[1].target) == (given[1].scan, given[1].target)


def _told(task: ScanTask, seen_rows: SeenRows | None) -> Outcome:
    return Outcome(task.scan, task.target, "made")


def test_what_a_task_raises_on_a_worker_is_its_outcome_alone(address: str, tmp_path: Path) -> None:
    found = {
        e.task: e.outcome
        for e in Cluster(address, _breaks).run(tasks_in(tmp_path, "ab"))
        if isinstance(e, Ended)
    }
    assert found[0].state == "made"
    assert "could not do it (ValueError: broken)" in found[1].sentence


def _breaks(task: ScanTask, seen_rows: SeenRows | None) -> Outcome:
    if task.scan.stem == "b":
        raise ValueError("broken")
    return Outcome(task.scan, task.target, "made")


def test_workers_of_another_version_are_told(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "__version__", "9.9")
    monkeypatch.setattr(cluster, "_version", lambda: "0.1")
    with pytest.raises(DeviceError, match=r"has version 0\.1 of dsl-scan, this is 9\.9"):
        next(Cluster(address, work.quick).run(tasks_in(tmp_path, "a")))


def test_a_scheduler_that_is_not_there_or_has_no_workers_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "ANSWER_S", 1.0)
    tasks = tasks_in(tmp_path, "a")
    with pytest.raises(DeviceError, match="does not answer"):
        next(Cluster("tcp://127.0.0.1:9", work.quick).run(tasks))
    with pytest.raises(DeviceError, match="has an address like tcp://"):
        next(Cluster("10.0.0.5", work.quick).run(tasks))
    with _scheduler(0) as empty, pytest.raises(DeviceError, match="has no workers"):
        next(Cluster(str(empty.scheduler_address), work.quick).run(tasks))
