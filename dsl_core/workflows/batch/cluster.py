"""Tasks on the workers of a cluster of Dask, whose scheduler somebody has started."""

from __future__ import annotations

import contextlib
import time
import uuid
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

from dsl_core.errors import Cancelled, DeviceError
from dsl_core.io.objects.address import address_of
from dsl_core.version import __version__
from dsl_core.workflows.batch.runner import Ended, Rows, given_up
from dsl_core.workflows.batch.task import Outcome, ScanTask, SeenRows, do_task

#: A scheduler that has not answered after so long is not there; how often to look for what ended. Seconds.
ANSWER_S, LOOK_S = 20.0, 0.05


class Cluster:
    """A `Runner` by a scheduler at an address like ``tcp://10.0.0.5:8786``.

    Workers need the same version of this program and see the same paths. Each should have one thread: a
    reconstruction uses several of its own.
    """

    def __init__(self, address: str, work: Callable[[ScanTask, SeenRows | None], Any] = do_task) -> None:
        self._address, self._work = address, work

    def run(self, tasks: Mapping[int, ScanTask]) -> Generator[Rows | Ended, None, None]:
        """Do tasks; Dask does one again whose worker dies, a few times, and none that has ended.

        Raises `DeviceError` when the scheduler is not there or disappears; what was complete is kept.
        """
        from distributed import Event

        topic, told = f"dsl-scan-{uuid.uuid4().hex}", SimpleQueue[Rows]()
        tasks = {number: _anywhere(task) for number, task in tasks.items()}
        with self._client() as client:
            client.subscribe_topic(topic, lambda event: told.put(Rows(*event[1])))
            # Not pure: done again where somebody has deleted the result since.
            futures = {
                client.submit(
                    _on_worker, self._work, task, number, topic, key=f"{topic}-{number}", pure=False
                ): number
                for number, task in tasks.items()
            }
            try:
                while futures:
                    for future in [each for each in futures if each.done()]:
                        number = futures.pop(future)
                        yield self._ended(number, tasks[number], future)
                        future.release()
                    while not told.empty():
                        yield told.get()
                    if client.status != "running":
                        raise self._lost()
                    time.sleep(LOOK_S)
            finally:
                if futures:
                    with contextlib.suppress(Exception):  # a scheduler that is gone cannot be told anything
                        Event(topic, client=client).set(timeout=ANSWER_S)
                        client.cancel(list(futures))

    @contextlib.contextmanager
    def _client(self) -> Iterator[Any]:
        """A connection to the scheduler, which has workers that can do the tasks."""
        from distributed import Client

        if not self._address.startswith(("tcp://", "tls://")):
            raise DeviceError(
                f"A scheduler has an address like tcp://10.0.0.5:8786, not {self._address!r}."
                " 'dask scheduler' prints its own."
            )
        try:
            client = Client(self._address, timeout=ANSWER_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise DeviceError(
                f"The scheduler {self._address} does not answer. Start it with 'dask scheduler', or check the"
                " address."
            ) from error
        try:
            self._require_workers(client)
            yield client
        finally:
            with contextlib.suppress(Exception):
                client.close(timeout=ANSWER_S)

    def _require_workers(self, client: Any) -> None:
        try:
            versions = client.run(_version)
        except ModuleNotFoundError as error:
            raise DeviceError(
                f"Workers of {self._address} lack dsl-scan ({error}). Install it for their Python."
            ) from error
        if not versions:
            raise DeviceError(
                f"The scheduler {self._address} has no workers. Start some with 'dask worker"
                f" {self._address} --nthreads 1', and run the same command again."
            )
        other = {worker: version for worker, version in versions.items() if version != __version__}
        if other:
            worker, version = next(iter(other.items()))
            raise DeviceError(
                f"The worker {worker} has version {version} of dsl-scan, this is {__version__}. Install"
                " the same everywhere: results of one batch should be comparable."
            )

    def _ended(self, number: int, task: ScanTask, future: Any) -> Ended:
        from distributed import KilledWorker

        if future.status in ("cancelled", "lost"):
            raise self._lost()
        error = future.exception()
        if isinstance(error, KilledWorker):
            return Ended(number, given_up(task, "each time with the worker that it was on"))
        if error is not None:
            sentence = f"A worker of {self._address} could not do it ({type(error).__name__}: {error})."
            return Ended(number, Outcome(task.scan, task.target, "failed", sentence))
        return Ended(number, future.result())

    def _lost(self) -> DeviceError:
        return DeviceError(
            f"The scheduler {self._address} was lost. Results that were complete are kept: start it, and"
            " run the same command again."
        )


def _anywhere(task: ScanTask) -> ScanTask:
    """The task with whole paths: a worker runs in another folder."""
    scan, target = (
        path if address_of(path) is not None else path.absolute() for path in (task.scan, task.target)
    )
    return replace(task, scan=scan, target=target)


def _version() -> str:
    return __version__


def _on_worker(
    work: Callable[[ScanTask, SeenRows | None], Any], task: ScanTask, number: int, topic: str
) -> Any:
    """Do a task, telling the client what is done of it; it stops where the client has."""
    from distributed import Event, get_worker

    worker, stop = get_worker(), Event(topic)

    def tell(done: int, total: int) -> None:
        if stop.is_set():
            raise Cancelled("The batch was stopped.")
        worker.log_event(topic, (number, done))

    return work(task, tell)
